"""Memory that ended sessions have freed goes back to the system."""

import gc
import os
import subprocess
import sys

import pytest
from support import ROOT

from zwerm.deploy.heap_memory import return_freed

PROGRAM = """
import ctypes, sys, threading
from pathlib import Path
from zwerm.deploy.heap_memory import return_freed, share_heaps

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20

if sys.argv[1] == "shared":
    share_heaps()
begun = threading.Barrier(8)
kept = []

def work():
    begun.wait()
    blocks = [bytes(1_000) for _ in range(4_000)]
    kept.append(blocks[::400])
    begun.wait()

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
before = resident_mb()
return_freed()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = ctypes.c_void_p(libc.fopen(sys.argv[2].encode(), b"w"))
libc.malloc_info(0, file)
libc.fclose(file)
print(Path(sys.argv[2]).read_text().count("<heap "), before - resident_mb())
"""

gnu = pytest.mark.skipif(
    sys.platform != "linux" or os.confstr("CS_GNU_LIBC_VERSION") is None,
    reason="only the GNU C library has these heaps",
)


@gnu
def test_threads_share_two_heaps_and_freed_memory_goes_back(tmp_path: object) -> None:
    found = {}
    for name in ("shared", "own"):
        command = [sys.executable, "-c", PROGRAM, name, f"{tmp_path}/{name}.xml"]
        ran = subprocess.run(command, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
        heaps, returned_mb = ran.stdout.split()
        found[name] = int(heaps)
        assert float(returned_mb) > 15.0, "of 32 MB"
    assert found["shared"] <= 2 < found["own"]


@gnu
def test_returning_memory_leaves_no_cycles() -> None:
    """In a run Python seldom looks for cycles, and memory is returned at every restart of a robot."""
    return_freed()
    gc.collect()
    return_freed()
    assert gc.collect() == 0

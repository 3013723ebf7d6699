"""The fork server of the robots: it has imported every controller of the catalogue before the first robot is forked."""

import subprocess
import sys

from support import ROOT

from zwerm.catalogue import ALGORITHMS


def test_controllers_of_robots_bases_coordinators_and_variants_are_imported_before_robots_are_forked() -> None:
    roles = {role for row in ALGORITHMS for role in row.controllers}
    groups = [row.controllers for row in ALGORITHMS]
    groups += [variant.controllers for row in ALGORITHMS for variant in row.variants]
    wanted = {path.partition(":")[0] for group in groups for named in group.values() for path in named.values()}
    assert roles == {"robot", "base", "coordinator"}
    assert "zwerm.agents.sensor_coverage.local_base" in wanted, "a base of a variant"
    program = "import sys, zwerm.deploy.preload; print(*(name for name in sys.argv[1:] if name not in sys.modules))"
    command = [sys.executable, "-c", program, *sorted(wanted), "zwerm.unknown"]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=True)
    assert ran.stdout.split() == ["zwerm.unknown"]


def test_readers_of_package_metadata_are_not_imported_before_robots_are_forked() -> None:
    """Each fork copies the tables of the server's memory, so what no robot uses makes every robot's start longer."""
    program = "import sys, zwerm.deploy.preload; print('importlib.metadata' in sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert ran.stdout.split() == ["False"]

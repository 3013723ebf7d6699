import os
import socket
import struct
from pathlib import Path

import pytest

from zwerm.link.session import close_without_waiting

LINGER_10_S = struct.pack("ii", 1, 10)


def open_descriptors() -> set[str]:
    return {path.name for path in Path("/dev/fd").iterdir()}


def waits_at_its_end(connection: socket.socket) -> bool:
    on, _ = struct.unpack("ii", connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))
    return bool(on)


@pytest.mark.parametrize(("seconds", "waits"), [(10, False), (7, True)], ids=["of Zenoh", "of another library"])
def test_only_connections_of_zenoh_close_at_once(seconds: int, waits: bool) -> None:
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, seconds))
        close_without_waiting()
        assert waits_at_its_end(connection) == waits


def test_letting_connections_close_at_once_leaves_no_descriptor_open() -> None:
    reading, writing = os.pipe()
    with socket.socket() as connection, Path(os.devnull).open():
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, LINGER_10_S)
        before = open_descriptors()
        close_without_waiting()
        assert open_descriptors() == before
    os.close(reading)
    os.close(writing)

"""Sets of robots, one bit for each id: an integer in memory, and its bytes on the wire. The union is `|`."""

from collections.abc import Iterable


def robot_set(robots: Iterable[int]) -> int:
    """Return the set of these robots."""
    return sum(1 << robot for robot in dict.fromkeys(robots))


def to_bytes(robots: int) -> bytes:
    """Return a set as it is sent; the empty set takes no byte."""
    return robots.to_bytes((robots.bit_length() + 7) // 8, "little")


def from_bytes(sent: bytes) -> int:
    """Return the set that was sent."""
    return int.from_bytes(sent, "little")


def members(robots: int) -> tuple[int, ...]:
    """Return the robots of a set, ascending."""
    return tuple(robot for robot in range(robots.bit_length()) if robots >> robot & 1)

"""The groups of runs by which landmark-based exploration is measured: the scenario of each, its settings and its seeds."""

from typing import Final

GOSSIP: Final = ("services.map=gossip", "services.assignment=claims")
SMALL: Final = ("robots.parameters.message_bytes_max=64",)
LONG: Final = "time.duration_s=1200"
LONGER: Final = "time.duration_s=1500"
LONGEST: Final = "time.duration_s=3000"
BEST_TURN: Final = "robots.parameters.turn_sd_rad=0.1"
BURSTS: Final = "radio.models=[{kind='gilbert_elliott', loss_fraction=0.2, burst_packets=8.0}]"


def robots(count: int) -> tuple[str, str]:
    """Return the settings for a number of robots."""
    return f"robots.count={count}", f"robots.parameters.robots_expected={count}"


# Group: scenario, settings, seeds.
GROUPS: Final[dict[str, tuple[str, tuple[str, ...], int]]] = {
    "free": ("landmark-free", (LONG,), 10),
    "free-gossip": ("landmark-free", (LONG, *GOSSIP), 20),
    "free-gossip-loss": ("landmark-free", (LONG, *GOSSIP, "radio.loss=0.5"), 20),
    "free-gossip-bursts": ("landmark-free", (LONG, *GOSSIP, BURSTS), 10),
    # Seeds 1 to 6 chose the rules for a short range: the others test them.
    "free-gossip-range": ("landmark-free", (LONG, *GOSSIP, "radio.range_m=0.7"), 20),
    "simple": ("landmark-simple", (LONG,), 10),
    "complex": ("landmark-complex", (LONGER,), 10),
    "complex-gossip": ("landmark-complex", (LONGER, *GOSSIP), 3),
    "complex-20": ("landmark-complex", (LONGEST, *robots(20)), 5),
    "complex-10": ("landmark-complex", (LONGEST, *robots(10)), 5),
    "complex-processes": ("landmark-complex", ("time.duration_s=20",), 1),
    # Fig. 9 of the paper.
    "free-20": ("landmark-free", (LONG, *robots(20)), 5),
    "free-30": ("landmark-free", (LONG, *robots(30)), 5),
    "simple-10": ("landmark-simple", (LONG, *robots(10)), 5),
    "simple-30": ("landmark-simple", (LONG, *robots(30)), 5),
    # More than 1,000 landmarks.
    "complex-updates": ("landmark-complex", ("time.duration_s=250", "arena.scale=1.08"), 1),
    "free-64-bytes": ("landmark-free", (LONG, *SMALL, "coordinator.parameters.message_bytes_max=64"), 10),
    "free-gossip-64-bytes": ("landmark-free", (LONG, *GOSSIP, *SMALL), 10),
    "presence": ("landmark-presence", (LONG,), 10),
    "free-nearest-frontier": ("landmark-free", (LONG, "coordinator.parameters.strategy=nearest-frontier"), 10),
    "free-min-pos": ("landmark-free", (LONG, "coordinator.parameters.strategy=min-pos"), 10),
    "random-walk": ("landmark-random-walk", ("time.duration_s=400",), 6),
    # The best turn of the study landmark-random-walk.
    "random-walk-best": ("landmark-random-walk", ("time.duration_s=400", BEST_TURN), 6),
    "complex-random-walk": (
        "landmark-complex",
        ("time.duration_s=350", *GOSSIP, "robots.parameters.strategy=random-walk", BEST_TURN),
        1,
    ),
    "navigate": ("landmark-navigate", (), 1),
    "navigate-presence": (
        "landmark-navigate",
        ("robots.parameters.presence_only=true", "robots.sensors.0.presence_only=true"),
        1,
    ),
    "halls": ("landmark-free", GOSSIP, 100),
}

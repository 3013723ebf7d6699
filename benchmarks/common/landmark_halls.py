"""Halls drawn by a seed, with trouble, in which landmark exploration without a coordinator must not conclude too early."""

import json

import numpy as np


def hall(seed: int) -> tuple[str, ...]:
    """Return the settings of a drawn hall: up to two boxes in it, 4 to 7 robots, and trouble of the radio."""
    random = np.random.default_rng([14, seed])
    width, height = random.uniform(2.6, 4.6), random.uniform(2.4, 3.6)
    boxes = []
    for each in range(int(random.integers(0, 3))):
        x, y = width * (0.2 + 0.45 * each), random.uniform(0.7, height - 1.3)
        dx, dy = random.uniform(0.3, 0.7, 2)
        boxes.append([[x, y], [x + dx, y], [x + dx, y + dy], [x, y + dy]])
    robots = int(random.integers(4, 8))
    trouble = (
        ("radio.loss=0.5",),
        ("radio.range_m=0.7",),
        ("radio.loss=0.5", "radio.range_m=0.7"),
        ("radio.models=[{kind='gilbert_elliott', loss_fraction=0.5, burst_packets=32.0}]",),
        ("faults=[{kind='partition', groups=[[0, 1], [2, 3]], at_s=2.0, for_s=60.0}]",),
        (
            "radio.loss=0.3",
            "faults=[{kind='crash', nodes=[1], at_s=15.0}, {kind='crash', nodes=[2], at_s=20.0, until_s=30.0}]",
        ),
    )[seed % 6]
    return (
        f"arena.size_m=[{width:.3f},{height:.3f}]",
        f"arena.obstacles={json.dumps([[[round(x, 3), round(y, 3)] for x, y in box] for box in boxes])}",
        f"scatter.dispersion_m={random.uniform(0.45, 0.65):.3f}",
        f"robots.count={robots}",
        f"robots.parameters.robots_expected={robots}",
        "robots.parameters.dead_ticks=800",
        "robots.on_crash=continue",
        *trouble,
    )

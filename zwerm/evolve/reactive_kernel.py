"""The kernel of a batch: arenas of robots whose wheel speeds depend on one bit of line of sight, compiled by numba.

The arenas are independent rectangles. Each tick a robot senses. Its command of `latency` ticks before moves it along an
arc, and overlaps are pushed apart. Contacts act on positions: each of two overlapping robots moves by half of the overlap, and
then walls push back. This is the contact model of Enki, the simulator of Ozdemir 2019. Numbers are single precision, in the
order that is written: no sum is fused or reordered.

Robots lie in rows of a multiple of LANES, of which those at the end are NaN: every comparison with them is false. This lets the
compiler handle several robots with one instruction.
"""

from collections.abc import Callable
from functools import cache
from hashlib import blake2b
from typing import Any, Final

import numpy as np

LANES: Final = 8

# Bits of the word that marks occupied cells.
CELLS_MAX: Final = 64

# The sums for the sine and cosine of half of a tick's turn are exact to 3e-6 up to this angle [rad].
HALF_TURN_MAX_RAD: Final = 1.0


@cache
def kernel() -> Callable[..., None]:
    """Return `move_arenas`, compiled. The compiled code is stored beside this file, so that only the first call takes seconds.

    Raises ModuleNotFoundError without numba.
    """
    import numba

    compiled: Callable[..., None] = numba.njit(cache=True, nogil=True, boundscheck=False)(move_arenas)
    return compiled


def kernel_digest() -> str:
    """Return a digest of what the kernel computes: it does not change with its comments."""
    code = move_arenas.__code__
    parts = (code.co_code, repr(code.co_consts[1:]).encode(), repr(code.co_names).encode())
    return blake2b(b"".join(parts), digest_size=8).hexdigest()


def move_arenas(
    position: Any,
    heading: Any,
    speeds: Any,
    keys: Any,
    ticks: int,
    latency: int,
    substeps: int,
    dt_s: float,
    wheel_base_m: float,
    radius_m: float,
    speed_max: float,
    noise: float,
    missed: float,
    imagined: float,
    size_m: Any,
    grid: Any,
    occupied: Any,
) -> None:
    """Move A arenas of n robots by `ticks` ticks, in place.

    `position` (A, n, 2) [m] and `heading` (A, n) [rad] float32 hold the start and then the end. `speeds` (A, 4) float32 are the
    wheel speeds [m/s] of each arena's robots: left and right without a robot in sight, left and right with one. `keys` (A,)
    uint32 key the noise. `noise` is the fraction of the wheels' noise; `missed` and `imagined` are the probabilities that a
    bit that is true or false is inverted. `size_m` (2,) is the arena with its corner in the origin. `occupied`
    (A, ticks + 1) uint8 receives the number of cells of `grid` (2,) = columns, rows with a robot at each tick.
    """
    arenas, robots = heading.shape
    width = (robots + LANES - 1) // LANES * LANES
    f = np.float32
    one, half = f(1.0), f(0.5)
    radius = f(radius_m)
    radius2 = radius * radius
    reach = f(2.0) * radius
    reach2 = reach * reach
    limit, noise_f = f(speed_max), f(noise)
    # Robots farther apart at the start of a tick do not meet in it, unless third ones push them.
    vicinity2 = (reach + f(4.0) * limit * f(dt_s)) ** 2
    step = f(dt_s / substeps)
    turn_step = f(dt_s / wheel_base_m)
    x_max, y_max = f(size_m[0]) - radius, f(size_m[1]) - radius
    columns, rows = grid[0], grid[1]
    to_column, to_row = f(columns / size_m[0]), f(rows / size_m[1])
    missed_below, imagined_below = np.uint32(missed * 65536.0), np.uint32(imagined * 65536.0)
    noisy_bits = missed > 0.0 or imagined > 0.0
    scale16 = f(1.0 / 65536.0)
    x = np.empty(width, dtype=np.float32)
    y = np.empty(width, dtype=np.float32)
    cos = np.empty(width, dtype=np.float32)
    sin = np.empty(width, dtype=np.float32)
    vx = np.zeros(width, dtype=np.float32)
    vy = np.zeros(width, dtype=np.float32)
    crowd = np.empty(robots, dtype=np.int64)
    solo = np.empty(width, dtype=np.float32)
    all_steps = f(substeps)
    left = np.zeros((latency + 1, width), dtype=np.float32)
    right = np.zeros((latency + 1, width), dtype=np.float32)
    for arena in range(arenas):
        x[:] = np.nan
        y[:] = np.nan
        cos[:] = one
        sin[:] = f(0.0)
        left[:] = f(0.0)
        right[:] = f(0.0)
        for i in range(robots):
            x[i] = position[arena, i, 0]
            y[i] = position[arena, i, 1]
            cos[i] = np.cos(heading[arena, i])
            sin[i] = np.sin(heading[arena, i])
        left_0, right_0 = speeds[arena, 0], speeds[arena, 1]
        left_1, right_1 = speeds[arena, 2], speeds[arena, 3]
        key = keys[arena]
        for tick in range(ticks + 1):
            # Ozdemir 2019, eq. 2: the cells that hold a robot, one bit each.
            cells = np.uint64(0)
            for i in range(robots):
                column = min(max(int(x[i] * to_column), 0), columns - 1)
                row = min(max(int(y[i] * to_row), 0), rows - 1)
                cells |= np.uint64(1) << np.uint64(row * columns + column)
            count = 0
            while cells:
                cells &= cells - np.uint64(1)
                count += 1
            occupied[arena, tick] = count
            if tick == ticks:
                break
            # Sense, and command: a ray of no width along the heading meets another robot's disc.
            now = tick % (latency + 1)
            crowded = 0
            for i in range(robots):
                xi, yi, ci, si = x[i], y[i], cos[i], sin[i]
                seen, close = np.int32(0), np.int32(0)
                for j in range(width):
                    dx, dy = x[j] - xi, y[j] - yi
                    close += np.int32(dx * dx + dy * dy < vicinity2)
                    across = ci * dy - si * dx
                    ahead = ci * dx + si * dy
                    seen |= np.int32((across * across <= radius2) & (ahead > f(0.0)))
                solo[i] = all_steps
                if close > 1:  # itself, and another
                    solo[i] = f(0.0)
                    crowd[crowded] = i
                    crowded += 1
                if noisy_bits:
                    word = np.uint32(np.uint32(np.uint32(tick * width + i) ^ np.uint32(0x5BD1E995)) ^ key)
                    word = np.uint32(np.uint32(word ^ (word >> np.uint32(16))) * np.uint32(0x7FEB352D))
                    word = np.uint32(np.uint32(word ^ (word >> np.uint32(15))) * np.uint32(0x846CA68B))
                    word = np.uint32(word >> np.uint32(16))
                    seen ^= np.int32(word < (missed_below if seen else imagined_below))
                left[now, i] = left_1 if seen else left_0
                right[now, i] = right_1 if seen else right_0
            # Act: the command of `latency` ticks ago, with noise, within the limits of the motors.
            acting = (tick + 1) % (latency + 1)
            for i in range(robots):
                word = np.uint32(tick * width + i)
                word = np.uint32(np.uint32(word ^ (word >> np.uint32(16))) * np.uint32(0x7FEB352D))
                word = np.uint32(np.uint32(word ^ (word >> np.uint32(15))) * np.uint32(0x846CA68B))
                word = np.uint32(np.uint32(word ^ (word >> np.uint32(16))) ^ key)
                word = np.uint32(np.uint32(word ^ (word >> np.uint32(16))) * np.uint32(0x21F0AAAD))
                word = np.uint32(np.uint32(word ^ (word >> np.uint32(15))) * np.uint32(0x735A2D97))
                word = np.uint32(word ^ (word >> np.uint32(15)))
                first = f(np.int32(word & np.uint32(0xFFFF))) * scale16
                second = f(np.int32(np.uint32(word >> np.uint32(16)))) * scale16
                wheel_left = left[acting, i] * (one + noise_f * (first + first - one))
                wheel_right = right[acting, i] * (one + noise_f * (second + second - one))
                wheel_left = min(max(wheel_left, -limit), limit)
                wheel_right = min(max(wheel_right, -limit), limit)
                # The chord of the arc: half of the turn, the way, and the other half.
                h = (wheel_right - wheel_left) * turn_step * half
                h2 = h * h
                sin_h = h * (one - h2 * (f(1 / 6) - h2 * (f(1 / 120) - h2 * f(1 / 5040))))
                cos_h = one - h2 * (half - h2 * (f(1 / 24) - h2 * f(1 / 720)))
                chord = one - h2 * (f(1 / 6) - h2 * f(1 / 120))
                way = (wheel_left + wheel_right) * half * step * chord
                cos_mid = cos[i] * cos_h - sin[i] * sin_h
                sin_mid = sin[i] * cos_h + cos[i] * sin_h
                vx[i] = way * cos_mid
                vy[i] = way * sin_mid
                cos_end = cos_mid * cos_h - sin_mid * sin_h
                sin_end = sin_mid * cos_h + cos_mid * sin_h
                length = f(1.5) - half * (cos_end * cos_end + sin_end * sin_end)
                cos[i] = cos_end * length
                sin[i] = sin_end * length
            # Robots with no other near take all steps at once.
            for i in range(robots):
                x[i] = min(max(x[i] + vx[i] * solo[i], radius), x_max)
                y[i] = min(max(y[i] + vy[i] * solo[i], radius), y_max)
            for _ in range(substeps if crowded else 0):
                for a in range(crowded):
                    i = crowd[a]
                    x[i] += vx[i]
                    y[i] += vy[i]
                for a in range(crowded):
                    i = crowd[a]
                    for b in range(a + 1, crowded):
                        j = crowd[b]
                        dx, dy = x[j] - x[i], y[j] - y[i]
                        distance2 = dx * dx + dy * dy
                        if f(0.0) < distance2 < reach2:
                            distance = np.sqrt(distance2)
                            push = half * (reach - distance) / distance
                            x[i] -= push * dx
                            y[i] -= push * dy
                            x[j] += push * dx
                            y[j] += push * dy
                for a in range(crowded):
                    i = crowd[a]
                    x[i] = min(max(x[i], radius), x_max)
                    y[i] = min(max(y[i], radius), y_max)
        for i in range(robots):
            position[arena, i, 0] = x[i]
            position[arena, i, 1] = y[i]
            heading[arena, i] = np.arctan2(sin[i], cos[i])

"""Places of slots from the directions between them and from the distances that robots drove, by least squares."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

# A distance that nobody drove counts as a hop [m], with this weight beside those that robots drove. It keeps two parts of the
# swarm apart that see each other in one direction only.
UNKNOWN_M: Final = 0.95
UNKNOWN_WEIGHT: Final = 0.02
# Weight of the origin as the place of every slot: directions and distances do not determine where all of them are.
RIDGE: Final = 1e-9


def places(
    directions: Mapping[tuple[int, int], complex], driven_m: Mapping[tuple[int, int], float]
) -> dict[int, complex]:
    """Return the places [m] of all slots that occur in `directions`, as complex numbers, up to a common displacement.

    `directions` are unit vectors from one slot to another, one for each pair, and `driven_m` the known distances [m] of such
    pairs. A pair gives two linear equations: the way from a to b has no part across the direction, and as long a part along it
    as was driven.
    """
    slots = sorted({slot for pair in directions for slot in pair})
    column = {slot: 2 * number for number, slot in enumerate(slots)}
    rows, columns, entries, wanted = list[int](), list[int](), list[float](), list[float]()

    def add(a: int, b: int, x: float, y: float, value: float, weight: float) -> None:
        """Add the equation that the way from a to b has this part along (x, y)."""
        rows.extend([len(wanted)] * 4)
        columns.extend((column[b], column[b] + 1, column[a], column[a] + 1))
        entries.extend((weight * x, weight * y, -weight * x, -weight * y))
        wanted.append(weight * value)

    for (a, b), there in directions.items():
        add(a, b, -there.imag, there.real, 0.0, 1.0)
        known = driven_m.get((a, b))
        add(a, b, there.real, there.imag, *((UNKNOWN_M, UNKNOWN_WEIGHT) if known is None else (known, 1.0)))
    if not wanted:
        return {}
    matrix = csc_array((entries, (rows, columns)), shape=(len(wanted), 2 * len(slots)))
    normal = csc_array(matrix.T @ matrix + RIDGE * eye_array(2 * len(slots)))
    found = splu(normal).solve(matrix.T @ np.array(wanted))
    return {slot: complex(found[at], found[at + 1]) for slot, at in column.items()}

"""Without a coordinator, `completed` must not be said either while the space behind a narrow opening is unseen."""

import pytest
from halls import EXACT, NOISE, carry_out

from benchmarks.common.until_in_sight import UntilInSight

ALONE = (EXACT, "services.path=gradient")
WITNESS = ("services.path=gradient", "time.duration_s=600.0")


@pytest.mark.parametrize(
    ("seed", "dies", "more"),
    [
        pytest.param(5, False, ALONE, id="a bend of 1.3 bodies"),
        pytest.param(5, True, (*ALONE, NOISE), id="noise, a body in a bend of 1.3 bodies"),
        pytest.param(13, True, ALONE, id="a body in a door of 1.8 bodies"),
        pytest.param(112, True, ALONE, id="a body in a corner of 1.5 bodies between two walks"),
        pytest.param(
            504,
            True,
            (*ALONE, NOISE, "time.duration_s=1000.0"),
            id="noise, triangles that cross in front of a bend of 1.4 bodies",
        ),
        pytest.param(504, True, WITNESS, id="a robot that saw a walk and died in a bend of 1.4 bodies"),
        pytest.param(625, False, (*WITNESS, NOISE), id="a robot past the end of a wall of a bend of 1.4 bodies"),
        pytest.param(
            625, True, (*WITNESS, NOISE), id="a walk around a robot that stood and died in a bend of 1.4 bodies"
        ),
        pytest.param(38, False, ALONE, id="a robot in a door beside which another one touched the wall"),
    ],
)
def test_robots_alone_pass_by_no_narrow_opening(seed: int, dies: bool, more: tuple[str, ...]) -> None:
    result = carry_out(seed, dies, more, UntilInSight())
    assert result.outcome != "completed" or result.metrics["reachable_coverage_fraction"] >= 0.98


@pytest.mark.parametrize(
    ("seed", "run_seed", "dies", "more"),
    [
        pytest.param(
            736, 1, False, NOISE, id="noise, a door: a standing robot touches one jamb, and a walking one the other"
        ),
        pytest.param(
            751,
            2,
            False,
            NOISE,
            id="noise, a bend of 1.6 bodies, where a walking robot pushed the only one that saw it",
        ),
        pytest.param(
            770, 1, True, NOISE, id="noise, a body in a chicane of 1.7 bodies in which a robot alone saw walks"
        ),
        pytest.param(
            763, 1, True, NOISE, id="noise, a robot that died in a chicane of 1.5 bodies on its way to a slot"
        ),
        pytest.param(
            952, 1, True, NOISE, id="noise, a body in a door of 2.8 bodies, and a neighbour that had stood for a moment"
        ),
        pytest.param(722, 1, True, EXACT, id="a body, and three robots that rely on each other in a circle"),
    ],
)
def test_robots_alone_pass_by_no_narrow_opening_with_other_seeds_of_the_run(
    seed: int, run_seed: int, dies: bool, more: str
) -> None:
    result = carry_out(seed, dies, (*ALONE, more), UntilInSight(), run_seed)
    assert result.outcome != "completed" or result.metrics["reachable_coverage_fraction"] >= 0.98

"""Drawn buildings in which a narrow opening was passed by: `completed` must not be said while the space behind it is unseen."""

import pytest
from halls import EXACT, NOISE, carry_out

from benchmarks.common.until_in_sight import UntilInSight

# Where a body, or robots that walk, fill the passage the run may have no end. Falsely it ended within 240 s.
BRIEF = "time.duration_s=500.0"


@pytest.mark.parametrize(
    ("seed", "dies", "more"),
    [
        pytest.param(5, False, (EXACT, BRIEF), id="central, a bend of 1.3 bodies"),
        pytest.param(5, False, (NOISE,), id="central, noise, a bend of 1.3 bodies"),
        pytest.param(28, False, (EXACT,), id="central, a chicane of 1.4 bodies, and corners at its mouth"),
        pytest.param(
            410, True, (NOISE,), id="central, noise, a body in a chicane of 1.4 bodies, in line with two robots"
        ),
        pytest.param(39, True, (NOISE, BRIEF), id="central, noise, a body behind a bend of 1.4 bodies"),
        pytest.param(
            100, True, (EXACT,), id="central, a body in a chicane of 1.7 bodies, and robots beside their slots"
        ),
        pytest.param(
            445,
            True,
            (EXACT, BRIEF),
            id="central, a body in a chicane of 1.6 bodies, where two robots rely on each other",
        ),
        pytest.param(
            442, True, (NOISE, BRIEF), id="central, noise, a body in a chicane of 1.4 bodies, and flat triangles"
        ),
        pytest.param(663, True, (EXACT,), id="central, a door of 1.4 bodies, of which a robot saw one jamb"),
        pytest.param(
            694, True, (NOISE,), id="central, noise, a body in a bend of 1.7 bodies, taken for a robot that stands"
        ),
    ],
)
def test_a_narrow_opening_is_not_passed_by(seed: int, dies: bool, more: tuple[str, ...]) -> None:
    result = carry_out(seed, dies, more, UntilInSight())
    assert result.outcome != "completed" or result.metrics["reachable_coverage_fraction"] >= 0.98


@pytest.mark.parametrize(
    ("seed", "run_seed", "dies", "more"),
    [
        pytest.param(694, 11, True, (NOISE,), id="noise, a body in a bend of 1.7 bodies, along which a robot looks"),
        pytest.param(
            445, 4, True, (NOISE,), id="noise, a chicane of 1.6 bodies, in which a robot died that had seen it"
        ),
        pytest.param(
            668, 3, True, (NOISE,), id="noise, a body in a chicane of 1.3 bodies beside the line of two robots"
        ),
        pytest.param(734, 1, False, (NOISE,), id="noise, a bend of 1.4 bodies, and a flat triangle"),
        pytest.param(
            734, 2, False, (NOISE,), id="noise, a bend of 1.4 bodies beside a robot that ties the end of a wall"
        ),
        pytest.param(734, 1, True, (NOISE,), id="noise, a body in a bend of 1.4 bodies past which two robots look"),
        pytest.param(769, 1, False, (NOISE,), id="noise, a chicane of 1.7 bodies, along whose mouth a robot looks"),
        pytest.param(
            769, 1, False, (EXACT,), id="a chicane of 1.7 bodies, whose corner hides a wall that was followed"
        ),
        pytest.param(770, 1, False, (EXACT,), id="a corner, which hides a wall that was followed"),
        pytest.param(
            770,
            1,
            False,
            (NOISE, BRIEF),
            id="noise, a bend of 1.7 bodies, and a robot behind the one in touch with that in the bend",
        ),
        pytest.param(777, 2, True, (NOISE,), id="noise, a body in a chicane of 1.4 bodies before two robots in touch"),
        pytest.param(
            826, 1, True, (EXACT,), id="a body in a chicane of 2.8 bodies, and two robots in touch beside its mouth"
        ),
        pytest.param(
            832, 2, False, (EXACT, BRIEF), id="a chicane of 1.6 bodies, of which a robot sees a part from afar"
        ),
        pytest.param(853, 2, True, (EXACT,), id="a body in a door of 1.3 bodies beside three robots in line"),
        pytest.param(943, 3, False, (EXACT,), id="a bend of 2 bodies, past whose corner a way along the wall begins"),
        pytest.param(
            969, 1, True, (EXACT, BRIEF), id="a body in a chicane of 1.5 bodies, past whose corner another wall ends"
        ),
        pytest.param(953, 1, False, (EXACT,), id="a chicane of 1.6 bodies, in which robots push another one on and on"),
        pytest.param(1030, 1, False, (NOISE,), id="noise, a bend of 1.9 bodies, seen between two robots at its mouth"),
        pytest.param(
            1062, 2, True, (NOISE,), id="noise, a chicane of 1.8 bodies, from which a robot kept a walk, and died"
        ),
        pytest.param(
            1410,
            2,
            True,
            (EXACT, BRIEF),
            id="a body in a bend of 1.4 bodies, and a corner in line with a robot behind it",
        ),
        pytest.param(
            1591,
            1,
            False,
            (EXACT, BRIEF),
            id="a chicane of 1.4 bodies, past whose corner a robot sees the walk along a line",
        ),
        pytest.param(
            1701, 2, True, (EXACT,), id="a body in a bend of 1.5 bodies, and a jamb in line with a robot behind it"
        ),
        pytest.param(
            1797,
            1,
            True,
            (NOISE, BRIEF),
            id="noise, a chicane of 1.5 bodies, whose corner hides a way from its station",
        ),
        pytest.param(
            1889,
            2,
            True,
            (EXACT,),
            id="a body in a chicane of 1.9 bodies, and a walk that begins behind its corner",
        ),
        pytest.param(
            1898,
            1,
            True,
            (NOISE, BRIEF),
            id="noise, a body in a chicane of 1.3 bodies, and a robot that came back to its slot beside the mouth",
        ),
        pytest.param(
            1922,
            2,
            True,
            (NOISE, BRIEF),
            id="noise, a body in a chicane of 1.5 bodies, past whose jamb a wall seemed to go on",
        ),
        pytest.param(776, 3, True, (EXACT,), id="a body in a bend of 1.8 bodies beside three robots in line"),
    ],
)
def test_a_narrow_opening_is_not_passed_by_with_other_seeds_of_the_run(
    seed: int, run_seed: int, dies: bool, more: tuple[str, ...]
) -> None:
    result = carry_out(seed, dies, more, UntilInSight(), run_seed)
    assert result.outcome != "completed" or result.metrics["reachable_coverage_fraction"] >= 0.98


@pytest.mark.parametrize(
    ("seed", "run_seed"),
    [
        pytest.param(804, 3, id="a station that sees an idle robot only does not begin again"),
        pytest.param(892, 2, id="the first robot of a station is lost from sight after each short walk"),
    ],
)
def test_the_space_beyond_a_chicane_comes_into_sight(seed: int, run_seed: int) -> None:
    result = carry_out(seed, False, (EXACT,), UntilInSight(), run_seed)
    assert result.metrics["reachable_coverage_fraction"] >= 0.98


def test_a_robot_that_did_not_reach_its_slot_in_a_passage_gets_one_where_it_stands() -> None:
    """Without a slot it fills the passage, and no path leads to the robots beyond."""
    result = carry_out(22, False, (EXACT, "time.duration_s=2000.0"))
    assert result.outcome == "completed"
    assert result.metrics["reachable_coverage_fraction"] >= 0.98

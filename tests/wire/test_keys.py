"""The key expressions of a run."""

from collections.abc import Callable

import pytest

from zwerm.wire import keys


def test_every_key_of_a_node_lies_where_the_design_says() -> None:
    assert keys.observation_key("r1", 7) == "zwerm/r1/node/7/obs"
    assert keys.command_key("r1", 7) == "zwerm/r1/node/7/cmd"
    assert keys.hello_key("r1", 7) == "zwerm/r1/hello/7"
    assert keys.alive_key("r1", 7) == "zwerm/r1/alive/7"
    assert keys.truth_key("r1", "scene") == "zwerm/r1/truth/scene"
    assert keys.command_key("r1", keys.EVERY) == "zwerm/r1/node/*/cmd"


@pytest.mark.parametrize("make", [keys.observation_key, keys.command_key, keys.hello_key, keys.alive_key])
@pytest.mark.parametrize("node", [0, 7, 99_999])
def test_the_node_is_read_back_from_its_keys(make: Callable[[str, int], str], node: int) -> None:
    assert keys.node_of(make("r1", node)) == node


@pytest.mark.parametrize(
    "key",
    [
        "",
        "zwerm",
        "zwerm/r1",
        "zwerm/r1/node",
        "zwerm/r1/truth/3",
        "zwerm/r1/other/3",
        "elsewhere/r1/node/3/obs",
        "zwerm/r1/node/*/obs",
        "zwerm/r1/node/x/obs",
        "zwerm/r1/node//obs",
        "zwerm/r1/node/-3/obs",
        "zwerm/r1/node/3_0/obs",
        "zwerm/r1/node/ 3/obs",
        "zwerm/r1/node/３/obs",
        "zwerm/r1/node/3",
        "zwerm/r1/node/3/obs/more",
        "zwerm/r1/hello/3/more",
    ],
)
def test_a_key_that_names_no_node_is_refused(key: str) -> None:
    with pytest.raises(ValueError, match="names no node"):
        keys.node_of(key)

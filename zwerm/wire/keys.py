"""The key expressions of a run, in one place: `zwerm/<run>/...`, with `*` for every node."""

import re
from typing import Final

ROOT: Final = "zwerm"
EVERY: Final = "*"

Node = int | str

_OF_A_NODE = re.compile(rf"{ROOT}/[^/]+/(?:node/([0-9]+)/(?:obs|cmd)|(?:hello|alive)/([0-9]+))")


def observation_key(run: str, node: Node) -> str:
    """The key on which the world publishes a node's observations."""
    return f"{ROOT}/{run}/node/{node}/obs"


def command_key(run: str, node: Node) -> str:
    """The key on which a node publishes its commands."""
    return f"{ROOT}/{run}/node/{node}/cmd"


def hello_key(run: str, node: Node) -> str:
    """The key of a node's request to join: a query, answered with a Welcome."""
    return f"{ROOT}/{run}/hello/{node}"


def alive_key(run: str, node: Node) -> str:
    """The liveliness token of a node: it vanishes when the process dies."""
    return f"{ROOT}/{run}/alive/{node}"


def air_key(run: str, channel: str, sender: Node, to: Node | None = None) -> str:
    """The key on which a node's radio on a real network sends: to all nodes of a channel, or to one."""
    return f"{ROOT}/{run}/air/{channel}/{sender}/{'all' if to is None else to}"


def hail_key(run: str, node: Node) -> str:
    """The key on which a node's radio announces itself to the others."""
    return f"{ROOT}/{run}/hail/{node}"


def truth_key(run: str, topic: str) -> str:
    """The key on which the world publishes the truth, for viewers only."""
    return f"{ROOT}/{run}/truth/{topic}"


def node_of(key: str) -> int:
    """Return the node id in a key made by this module.

    Raises ValueError where the key names no node.
    """
    found = _OF_A_NODE.fullmatch(key)
    if found is None:
        raise ValueError(f"{key}: names no node")
    return int(found[1] or found[2])

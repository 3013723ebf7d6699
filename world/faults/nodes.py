"""Faults of nodes, for robots, a base station and the coordinator alike.

    crash     the program dies (SIGKILL in processes); with an end it is started again, as a new incarnation without memory
    restart   it dies and is started again at the same tick
    pause     it is stopped and goes on later (SIGSTOP, SIGCONT); its motors stop after the deadman time
    slow      it takes `every_ticks` ticks over each answer: it is observed that seldom, and its commands act that late
    join      it is not started before; its body stands there without power

What a fault does to a program is the same at the same tick inline and in processes.
"""

from typing import Annotated, ClassVar

from pydantic import Field

from zwerm.world.faults import FaultTable, Nodes, Share


class CrashTable(FaultTable):
    """These nodes are dead while it lasts, or `fraction` of the robots in the arena, one at least, that the seed draws then.

    Who is drawn is no base station, and not dead yet.
    """

    nodes: Nodes | None = None
    fraction: Share | None = None


class RestartTable(FaultTable):
    """These nodes lose their memory."""

    lasts: ClassVar[bool] = False
    nodes: Nodes


class PauseTable(FaultTable):
    """These nodes are stopped while it lasts."""

    nodes: Nodes


class SlowTable(FaultTable):
    """These nodes take `every_ticks` ticks over each answer while it lasts."""

    nodes: Nodes
    every_ticks: Annotated[int, Field(ge=2, le=10_000)]


class JoinTable(FaultTable):
    """These nodes start only then."""

    lasts: ClassVar[bool] = False
    nodes: Nodes

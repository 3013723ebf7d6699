"""Robots that leave the complex by agreement among neighbours: the coordinator's requests, and the robots that have left.

The coordinator asks robots that the frontier does not need: they are not on the fence, and their slot would not be
expanded to again. The robots decide, by the link criterion and with a lock from every neighbour. No neighbour of a
robot that has left or is silent can leave. Each scan reports which robots have left, so a coordinator needs no
memory of them.
"""

from collections.abc import Collection, Iterator, Mapping

from zwerm.agents.sensor_coverage.frontier.exposure import opens
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import LeftComplex, NegotiateLeave, Report
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Routine
from zwerm.maths.simplicial import Edge, may_leave


class LeaveRequests:
    """The robots that have left, by their reports. `corner_margin_rad` is the planner's."""

    def __init__(self, corner_margin_rad: float, slots: Slots, mailbox: CommandMailbox) -> None:
        self._corner_margin_rad = corner_margin_rad
        self._slots = slots
        self._mailbox = mailbox
        self._left: dict[int, None] = {}

    def update(self, reports: Mapping[int, Report]) -> None:
        """Take in the reports of all robots that answer."""
        self._left = dict.fromkeys(robot for robot, report in reports.items() if isinstance(report, LeftComplex))

    def negotiate(
        self, scan: ScanResult, boundary_edges: Collection[Edge], silent: Collection[int], cycle: int
    ) -> Routine[None]:
        """Have robots negotiate, and wait for their answers; `silent` robots agree to nothing."""
        occupant = self._slots.occupant
        asked = [occupant[slot] for slot in self._candidates(scan, boundary_edges, silent)]
        for robot in asked:
            self._mailbox.send(robot, NegotiateLeave(cycle), drive=True)
        answers = yield from self._mailbox.answers(asked, Report)
        self._left |= dict.fromkeys(robot for robot, answer in answers.items() if isinstance(answer, LeftComplex))

    def _candidates(self, scan: ScanResult, boundary_edges: Collection[Edge], silent: Collection[int]) -> Iterator[int]:
        """Yield the slots that the frontier does not need and that can be vacated."""
        slots = self._slots
        guarded = {slot for each in boundary_edges for slot in each} | set(scan.bases)
        for slot in scan.complex_.vertices:
            seen = slots.view.get(slots.occupant[slot], ())
            if slot in guarded or any(node in self._left or node in silent for node in seen):
                continue
            if not opens(scan, slot, self._corner_margin_rad):
                yield slot

    def redundant_slots(self, scan: ScanResult) -> tuple[int, ...]:
        """Return the slots whose robots have left and that are not needed; a neighbour may have died since."""
        views, complex_, bases = scan
        found: list[int] = []
        for slot in (each for each, robot in self._slots.occupant.items() if robot in self._left):
            left = ScanResult(views, complex_, bases)
            if may_leave(slot, complex_.neighbours) and not opens(left, slot, self._corner_margin_rad):
                found.append(slot)
                complex_ = complex_.without([slot])
        return tuple(found)

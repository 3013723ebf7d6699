"""Robots that leave the complex by agreement among neighbours: whom the coordinator has find out, and who has left.

It asks those whom the frontier would not miss: not on the fence, and nobody would be sent there again. They decide, by the
link criterion and with a lock from every neighbour; where a robot stands that has left or is silent, no neighbour of it can
leave. Each survey tells anew who is out, so a coordinator without memory knows as much as any.
"""

from collections.abc import Collection, Iterator, Mapping

from zwerm.agents.sensor_coverage.frontier.exposure import opens
from zwerm.agents.sensor_coverage.frontier.services import ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import LeftComplex, NegotiateLeave, Report
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Story
from zwerm.maths.simplicial import Edge, may_leave


class LeaveRequests:
    """Who has left, by what robots reported. `corner_margin_rad` is the planner's."""

    def __init__(self, corner_margin_rad: float, places: Slots, post: CommandMailbox) -> None:
        self._corner_margin_rad = corner_margin_rad
        self._places = places
        self._post = post
        self._left: dict[int, None] = {}

    def note(self, reports: Mapping[int, Report]) -> None:
        """Take note of who has left, by the reports of all that answer."""
        self._left = dict.fromkeys(robot for robot, report in reports.items() if isinstance(report, LeftComplex))

    def hold(self, picture: ScanResult, rim: Collection[Edge], silent: Collection[int], cycle: int) -> Story[None]:
        """Have robots find out who can leave, and wait until they have; `silent` ones can agree to nothing."""
        occupant = self._places.occupant
        asked = [occupant[place] for place in self._inner(picture, rim, silent)]
        for robot in asked:
            self._post.say(robot, NegotiateLeave(cycle), drive=True)
        answers = yield from self._post.answers(asked, Report)
        self._left |= dict.fromkeys(robot for robot, answer in answers.items() if isinstance(answer, LeftComplex))

    def _inner(self, picture: ScanResult, rim: Collection[Edge], silent: Collection[int]) -> Iterator[int]:
        """Yield the places that the frontier would not miss, but for those that cannot be left."""
        places = self._places
        guarded = {place for each in rim for place in each} | set(picture.bases)
        for place in picture.complex_.vertices:
            seen = places.view.get(places.occupant[place], ())
            if place in guarded or any(node in self._left or node in silent for node in seen):
                continue
            if not opens(picture, place, self._corner_margin_rad):
                yield place

    def spare(self, picture: ScanResult) -> tuple[int, ...]:
        """Return the places that robots have left, and that are not missed: somebody else may have died since."""
        views, complex_, bases = picture
        found: list[int] = []
        for place in (each for each, robot in self._places.occupant.items() if robot in self._left):
            left = ScanResult(views, complex_, bases)
            if may_leave(place, complex_.neighbours) and not opens(left, place, self._corner_margin_rad):
                found.append(place)
                complex_ = complex_.without([place])
        return tuple(found)

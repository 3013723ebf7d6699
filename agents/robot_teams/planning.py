"""The lead's decisions: which corridors its free robots form next, and when the team divides. Pure functions.

Latimer et al. 2002, sections 3.3 and 3.4. A corridor begins at the open end or port nearest to a free robot. Robots for which
the map shows no room in it take the next open cell, if there is one near. If a robot found a new segment on its own
slice, a reverse critical point lies between it and its predecessor. Then the team divides: this robot and those behind
it take the new cell.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.robot_teams.mapping.facts import LEFT, RIGHT, TOP, End
from zwerm.agents.robot_teams.mapping.slice_map import CoverageCertificate, SliceMap
from zwerm.agents.robot_teams.protocols.team_messages import READY, CorridorPlan, Status, View

FAR: Final = 10**9
# The side of the anchor of a plan that only joins the maps of robots that began apart.
LINK: Final = 0
# Distance beyond the ends of its anchor's segment up to which a corridor reserves its cell [mm].
BESIDE_MM: Final = 500


class Task(NamedTuple):
    """The start of a corridor: an end that is not swept (`own_slice`), or the open port of one that is."""

    end: End
    direction: int
    own_slice: bool


class Reservation(NamedTuple):
    """The part of the arena that a corridor works in: slices `low` to `high`, heights `bottom_mm` to `top_mm`."""

    low: int
    high: int
    bottom_mm: int
    top_mm: int

    def holds(self, task: Task) -> bool:
        """Return whether a task lies in it."""
        end = task.end
        slab = end.slice if task.direction == RIGHT else end.slice - 1
        beside = self.bottom_mm - BESIDE_MM <= end.y_mm <= self.top_mm + BESIDE_MM
        return beside and self.low <= slab <= self.high


def open_tasks(slice_map: SliceMap) -> list[Task]:
    """Return everything that is open: ends without mate with the direction in which to go on, and ports of swept ends."""
    return _tasks(slice_map, slice_map.certificate)


def _tasks(slice_map: SliceMap, certificate: CoverageCertificate) -> list[Task]:
    unswept = dict.fromkeys(certificate.ends_without_mate)
    tasks = []
    for end in unswept:
        sides = [side for side in (RIGHT, LEFT) if slice_map.arc(end, side) is None]
        tasks.append(Task(end, sides[0] if len(sides) == 1 else RIGHT, True))
    return tasks + [Task(end, side, False) for end, side in certificate.open_ports if end not in unswept]


def reservation(slice_map: SliceMap, plan: CorridorPlan) -> Reservation:
    """Return where the robots of a plan work."""
    anchor, reach = plan.anchor, len(plan.order) * plan.direction
    if anchor.side == LINK:
        return Reservation(0, -1, 0, 0)
    # A slab has the number of the slice on its left. One more to either side: hunts go back, and the next corridor goes on.
    first = anchor.slice if plan.direction == RIGHT else anchor.slice - 1
    low, high = sorted((first - plan.direction, first + reach))
    known = slice_map.end(anchor)
    mate = None if known is None else slice_map.mate(known)
    if mate is not None:
        bottom, top = sorted((anchor.y_mm, mate.stop.y_mm))
    elif anchor.side == TOP:
        bottom, top = -FAR, anchor.y_mm
    else:
        bottom, top = anchor.y_mm, FAR
    return Reservation(low, high, bottom, top)


def room(slice_map: SliceMap, task: Task, count: int) -> int:
    """Return the number of robots, of `count`, for which a corridor has room by the map: at least one."""
    k, found = task.end.slice, 1 if task.own_slice else 0
    if slice_map.is_virtual(task.end) or (task.own_slice and slice_map.arc(task.end, task.direction) is not None):
        return 1
    while found < count:
        k += task.direction
        if slice_map.is_swept(k, task.end.y_mm):
            break
        found += 1
    return max(found, 1)


def latest_plans(plans: Sequence[CorridorPlan], view: View) -> dict[int, CorridorPlan]:
    """Return for each member of the view its latest plan, if it has one."""
    latest: dict[int, CorridorPlan] = {}
    for plan in plans:
        if plan.epoch == view.epoch:
            for node in plan.order:
                if node not in latest or plan.number > latest[node].number:
                    latest[node] = plan
    return latest


def free_members(view: View, plans: Sequence[CorridorPlan], statuses: Mapping[int, Status]) -> list[int]:
    """Return the members that have finished their latest plan: the barrier of a corridor is that all of its robots are free."""
    latest = latest_plans(plans, view)
    free = []
    for node in view.members:
        status = statuses.get(node)
        number = latest[node].number if node in latest else 0
        if status is not None and status.phase == READY and (status.epoch, status.number) == (view.epoch, number):
            free.append(node)
    return free


def without_busy(plans: Sequence[CorridorPlan], free: Collection[int]) -> list[CorridorPlan]:
    """Return the plans whose robots are all free."""
    return [plan for plan in plans if all(node in free for node in plan.order)]


def finder(order: Sequence[int], statuses: Mapping[int, Status]) -> int | None:
    """Return the place in the formation of the first robot that found a new segment on its own slice."""
    for index, node in enumerate(order):
        status = statuses.get(node)
        if status is not None and status.found:
            return index
    return None


def division(view: View, order: Sequence[int], index: int) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Return the two groups when robot `index` of a formation found a new cell: it and those behind it, and all others.

    If the lead of the formation found it, the formation splits in half. None where a group would be empty.
    """
    cut = index + 1 if index + 1 < len(order) else len(order) // 2
    new = tuple(order[:cut])
    rest = tuple([node for node in view.members if node not in new])
    return (new, rest) if new and rest else None


def assign(
    slice_map: SliceMap,
    view: View,
    plans: Sequence[CorridorPlan],
    reserving: Sequence[CorridorPlan],
    statuses: Mapping[int, Status],
    skip: Collection[tuple[Task, int]],
    one_corridor: bool,
    join_mm: int,
) -> list[CorridorPlan]:
    """Return new plans for the free members. With `one_corridor` the whole team forms one corridor at a time.

    While others are busy, no robot travels farther than `join_mm`: a nearer task comes later. The busy plans among
    `reserving` keep others out of their cells. `skip` has the tasks that recently gave nothing new, each with a robot
    that tried.
    """
    free = free_members(view, plans, statuses)
    if not free or (one_corridor and len(free) < len(view.members)):
        return []
    number = max([plan.number for plan in plans if plan.epoch == view.epoch], default=0)
    latest = latest_plans(plans, view)
    active = list({plan.number: plan for node, plan in latest.items() if node not in free}.values())
    reserved = [reservation(slice_map, plan) for plan in active if plan in reserving]
    places = {node: _place(slice_map, statuses.get(node)) for node in free}
    if number == 0 and len(free) > 1 and _apart(slice_map, places):
        return [CorridorPlan(view.epoch, 1, End(0, LINK, 0), RIGHT, False, tuple(free))]
    distances = {node: slice_map.distances(at) for node, at in places.items() if at is not None}
    members = [statuses[node] for node in view.members if node in statuses]
    swept = {status.sweeping for status in members if status.phase != READY}
    tasks = open_tasks(slice_map)
    # If no open end or port can be reached, the robot explores the cause that blocks the way: a wreck, or a wrong
    # measurement.
    for node in [node for node in distances if tasks and not any(task.end in distances[node] for task in tasks)]:
        tasks += _tasks(slice_map, slice_map.openings(distances[node]))
    tasks = list(dict.fromkeys(tasks))
    tasks = [task for task in tasks if not (task.own_slice and task.end.slice in swept)]
    made: list[CorridorPlan] = []
    limit = join_mm if active else FAR - 1
    waiting = [node for node in free if node in distances]
    while waiting:
        best: tuple[int, int, int, Task] | None = None
        for node in waiting:
            before = latest.get(node)
            for task in tasks:
                far = distances[node].get(task.end, FAR)
                turns = int(before is not None and before.direction != task.direction)
                if far > limit or (best is not None and (far, turns) > best[:2]):
                    continue
                if (task, node) in skip or any(each.holds(task) for each in reserved):
                    continue
                rank = (far, turns, -node, task)
                if best is None or rank < best:
                    best = rank
        if best is None:
            break
        task = best[3]
        # The robots go in single file: the nearest goes first, and so goes farthest. The last in the order is the lead.
        away = {each: distances[each].get(task.end, FAR) for each in waiting}
        near = sorted(waiting, key=lambda each: (away[each], _behind_mm(statuses[each], places[each], task), each))
        reach = max(join_mm, best[0])
        near = [each for each in near if away[each] <= reach and (task, each) not in skip]
        near = near[: room(slice_map, task, len(waiting))]
        number += 1
        plan = CorridorPlan(view.epoch, number, task.end, task.direction, task.own_slice, tuple(reversed(near)))
        made.append(plan)
        reserved.append(reservation(slice_map, plan))
        waiting = [node for node in waiting if node not in near]
        limit = join_mm
        if one_corridor:
            break
    return made


def _behind_mm(status: Status, place: End | None, task: Task) -> int:
    """Return how far a robot stands behind others at the same place, on the way to a task: only differences count.

    Robots in single file cannot pass each other.
    """
    if place == task.end:
        return -task.direction * status.x_mm
    if place is None or place.slice == task.end.slice:
        return abs(status.y_mm - task.end.y_mm)
    return -status.x_mm if task.end.slice > place.slice else status.x_mm


def _place(slice_map: SliceMap, status: Status | None) -> End | None:
    return None if status is None or status.at is None else slice_map.end(status.at)


def _apart(slice_map: SliceMap, places: Mapping[int, End | None]) -> bool:
    """Return whether some of the robots stand at ends between which no way is known."""
    known = [place for place in places.values() if place is not None]
    return bool(known) and not slice_map.distances(known[0]).keys() >= dict.fromkeys(known).keys()

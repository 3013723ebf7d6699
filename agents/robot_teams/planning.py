"""The lead's decision at the barrier: the next corridor, a division, or that everything is covered. A pure function.

Latimer et al. 2002, sections 3.3 and 3.4. The next corridor begins at the open end or port nearest to the team. Where a
robot found a new segment on its own slice, a reverse critical point lies between it and its predecessor: it and those behind
it take the new cell, the others keep theirs. Robots for which the corridor had no slice divide off too.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.robot_teams.facts import LEFT, RIGHT, End
from zwerm.agents.robot_teams.messages import Plan, Status, View
from zwerm.agents.robot_teams.slice_map import SliceMap

FAR: Final = 10**9

# Something open: an end without mate, or an open port, and the direction of the corridor that begins there.
Item = tuple[End, int, bool]


class Task(NamedTuple):
    """Where a corridor begins."""

    end: End
    direction: int
    own_slice: bool


class Division(NamedTuple):
    """The groups into which the team splits."""

    groups: tuple[tuple[int, ...], ...]


def open_tasks(slice_map: SliceMap) -> list[Task]:
    """Return everything that is open: ends without mate with the direction in which to go on, and ports of swept ends."""
    certificate = slice_map.certificate
    tasks = []
    unswept = dict.fromkeys(certificate.ends_without_mate)
    for end in unswept:
        sides = [side for side in (RIGHT, LEFT) if slice_map.arc(end, side) is None]
        tasks.append(Task(end, sides[0] if len(sides) == 1 else RIGHT, True))
    tasks += [Task(end, side, False) for end, side in certificate.open_ports if end not in unswept]
    return tasks


def nearest_task(slice_map: SliceMap, start: End, skip: Mapping[Task, int], direction: int) -> tuple[Task, int] | None:
    """Return the nearest open task and its distance [mm]; of equals, one that goes on in `direction`."""
    distances = slice_map.distances(start)
    best: tuple[int, int, Task] | None = None
    for task in open_tasks(slice_map):
        if task in skip or task.end not in distances:
            continue
        rank = (distances[task.end], int(task.direction != direction), task)
        if best is None or rank < best:
            best = rank
    return None if best is None else (best[2], best[0])


def decide(
    slice_map: SliceMap,
    view: View,
    statuses: Mapping[int, Status],
    last: Plan | None,
    skip: Mapping[Task, int],
    divides: bool,
) -> Plan | Division | None:
    """Return what the team does next; None where nothing is open that it could reach."""
    places = {node: _place(slice_map, statuses.get(node)) for node in view.members}
    order = last.order if last is not None and last.epoch == view.epoch else ()
    ranked = [*[node for node in order if node in view.members], *[node for node in view.members if node not in order]]
    number = last.number + 1 if last is not None and last.epoch == view.epoch else 1
    direction = last.direction if last is not None else RIGHT
    apart = _components(slice_map, ranked, places)
    if len(apart) > 1:
        # The maps of robots that began apart are not joined: walk back to the predecessor's slice first, else split.
        if number == 1 or (last is not None and last.order):
            return Plan(view.epoch, number, End(0, 0, 0), direction, False, ())
        return Division(apart)
    if divides and len(ranked) > 1 and last is not None and last.epoch == view.epoch and last.order:
        groups = _groups(slice_map, ranked, statuses, places, skip)
        if groups is not None:
            return Division(groups)
    for node in reversed(ranked):
        place = places[node]
        found = None if place is None else nearest_task(slice_map, place, skip, direction)
        if found is None:
            continue
        task = found[0]
        distances = slice_map.distances(task.end)
        far = {each: distances.get(at, FAR) if (at := places[each]) is not None else FAR for each in ranked}
        # The nearest goes first, and so farthest: single file.
        near = sorted(ranked, key=lambda each: (far[each], -ranked.index(each)))[: room(slice_map, task, len(ranked))]
        if divides and len(near) < len(ranked):
            rest = tuple([each for each in ranked if each not in near])
            if _elsewhere(slice_map, task, rest, places, skip):
                return Division((tuple(near), rest))
        return Plan(view.epoch, number, task.end, task.direction, task.own_slice, tuple(reversed(near)))
    return None


def room(slice_map: SliceMap, task: Task, count: int) -> int:
    """Return for how many of `count` robots a corridor has room, as far as the map tells: at least one."""
    k, found = task.end.slice, 1 if task.own_slice else 0
    if task.own_slice and slice_map.arc(task.end, task.direction) is not None:
        return 1
    while found < count:
        k += task.direction
        if slice_map.is_swept(k, task.end.y_mm):
            break
        found += 1
    return max(found, 1)


def _elsewhere(
    slice_map: SliceMap,
    task: Task,
    rest: Sequence[int],
    places: Mapping[int, End | None],
    skip: Mapping[Task, int],
) -> bool:
    """Tell whether the rest of a team has something to do in another slab than `task`."""
    taken = _slabs([task])
    others = [each for each in open_tasks(slice_map) if not _slabs([each]).keys() & taken.keys()]
    known = [place for node in rest if (place := places[node]) is not None]
    reached = slice_map.distances(known[0]) if known else {}
    return any(each.end in reached and each not in skip for each in others)


def _place(slice_map: SliceMap, status: Status | None) -> End | None:
    return None if status is None or status.at is None else slice_map.end(status.at)


def _components(
    slice_map: SliceMap, ranked: Sequence[int], places: Mapping[int, End | None]
) -> tuple[tuple[int, ...], ...]:
    """Return the members whose ends are joined by known ways, group by group."""
    groups: list[tuple[dict[End, int], list[int]]] = []
    for node in reversed(ranked):
        place = places[node]
        if place is None:
            continue
        for distances, members in groups:
            if place in distances:
                members.append(node)
                break
        else:
            groups.append((slice_map.distances(place), [node]))
    lost = [node for node in ranked if places[node] is None]
    if groups:
        groups[0][1].extend(lost)
    return tuple([tuple(members) for _, members in groups])


def _groups(
    slice_map: SliceMap,
    ranked: Sequence[int],
    statuses: Mapping[int, Status],
    places: Mapping[int, End | None],
    skip: Mapping[Task, int],
) -> tuple[tuple[int, ...], ...] | None:
    """Return how the team splits, or None if there is no reason to, or less than two things to do."""
    starts = [task for task in open_tasks(slice_map) if task not in skip]
    if len(starts) < 2:
        return None
    finders = [
        index for index, node in enumerate(ranked) if (status := statuses.get(node)) is not None and status.found
    ]
    if finders:
        # The finder and those behind it take the new cell; if it is the last of the formation, half of the team does.
        cut = finders[0] + 1
        if cut == len(ranked):
            cut = len(ranked) // 2
        return tuple(ranked[:cut]), tuple(ranked[cut:])
    return None


def _slabs(tasks: Sequence[Task]) -> dict[tuple[int, int], None]:
    """Return the slabs that open tasks lead into, as far as can be told: by the slice on their left, and their direction."""
    return {(task.end.slice if task.direction == RIGHT else task.end.slice - 1, task.direction): None for task in tasks}

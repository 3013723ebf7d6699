"""What leaving does to the swarm's complex, in truth: a checker of every robot that left it.

A robot that leaves the complex says so to those who watch, and again if it takes a place anew. The complex is that of all
living robots in the arena but those; who sees whom is what the world knows, not what robots believe.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

from zwerm.maths.simplicial import betti
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.metrics.sight import complex_of

if TYPE_CHECKING:
    from zwerm.world.world import World


def removals(world: "World", range_m: float) -> dict[str, float]:
    """Return how many robots have left the complex, and how many of these changed its b0 or b1."""
    out: dict[int, None] = {}
    dead = dict.fromkeys(world.dead)
    count = unsafe = 0
    sight = Visibility()
    for each in world.audience.told:
        removal = each.told.get("removal")
        if removal is None:
            continue
        if "in" in removal:
            out.pop(removal["in"], None)
            continue
        scene = replace(world.scene, tick=each.tick, position=each.position, present=each.present)
        members = [node for node in scene.present_ids().tolist() if node not in out and node not in dead]
        whole = complex_of(sight.pairs(scene, range_m), members)
        count += 1
        unsafe += betti(whole) != betti(whole.without([removal["out"]]))
        out[removal["out"]] = None
    return {"removals": float(count), "unsafe_removals": float(unsafe)}

"""The task in ARGoS, where `argos3` is installed (https://www.argos-sim.info): foot-bots with a controller in Lua.

    python benchmarks/speed/peers/argos_swarm.py 100 600

Foot-bots stand for e-pucks, which are a plug-in of their own: they are larger, so each has 16 times the area. The range and
bearing sensor gives the bit: a message from straight ahead. The wheels have the e-puck's speeds. The program writes the
configuration and the controller to a temporary folder, and prints robot-ticks per second of processor time as JSON.
`--keep DIR` keeps both files. The configuration follows the manual; it was not run for the tables of the documentation.
"""

import argparse
import json
import math
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from line_of_sight import DT_S, SPEED_M_S, WHEELS, side_m

RADIUS_M = 0.085
LARGER = 4.0

CONTROLLER = """-- One bit of line of sight selects one of two pairs of wheel speeds [cm/s].
local alone, sighted = {{{alone}}}, {{{sighted}}}

function init()
  robot.range_and_bearing.set_data(1, 1)
end

function step()
  local wheels = alone
  for _, message in ipairs(robot.range_and_bearing) do
    local bearing = message.horizontal_bearing
    if math.cos(bearing) > 0 and math.abs(math.sin(bearing)) * message.range <= {radius_cm} then
      wheels = sighted
    end
  end
  robot.wheels.set_velocity(wheels[1], wheels[2])
end

function reset()
  init()
end

function destroy()
end
"""

CONFIGURATION = """<?xml version="1.0" ?>
<argos-configuration>
  <framework>
    <system threads="0" />
    <experiment length="{length_s}" ticks_per_second="{rate}" random_seed="1" />
  </framework>
  <controllers>
    <lua_controller id="lua">
      <actuators>
        <differential_steering implementation="default" />
        <range_and_bearing implementation="default" />
      </actuators>
      <sensors>
        <range_and_bearing implementation="medium" medium="rab" />
      </sensors>
      <params script="{script}" />
    </lua_controller>
  </controllers>
  <arena size="{arena_m}, {arena_m}, 1" center="0, 0, 0.5">
    <box id="north" size="{arena_m}, 0.1, 0.5" movable="false"><body position="0, {half_m}, 0" orientation="0, 0, 0" /></box>
    <box id="south" size="{arena_m}, 0.1, 0.5" movable="false"><body position="0, -{half_m}, 0" orientation="0, 0, 0" /></box>
    <box id="east" size="0.1, {arena_m}, 0.5" movable="false"><body position="{half_m}, 0, 0" orientation="0, 0, 0" /></box>
    <box id="west" size="0.1, {arena_m}, 0.5" movable="false"><body position="-{half_m}, 0, 0" orientation="0, 0, 0" /></box>
    <distribute>
      <position method="uniform" min="-{inner_m}, -{inner_m}, 0" max="{inner_m}, {inner_m}, 0" />
      <orientation method="uniform" min="0, 0, 0" max="360, 0, 0" />
      <entity quantity="{robots}" max_trials="1000">
        <foot-bot id="robot" rab_range="{arena_m}"><controller config="lua" /></foot-bot>
      </entity>
    </distribute>
  </arena>
  <physics_engines><dynamics2d id="dyn2d" iterations="10" /></physics_engines>
  <media><range_and_bearing id="rab" index="grid" grid_size="{cells}, {cells}, 1" /></media>
</argos-configuration>
"""


def files(folder: Path, robots: int, ticks: int) -> Path:
    """Write the controller and the configuration, and return the path of the latter."""
    size_m = LARGER * side_m(robots)
    alone, sighted = (", ".join(f"{100.0 * SPEED_M_S * wheel:.6g}" for wheel in pair) for pair in WHEELS)
    script, configuration = folder / "line_of_sight.lua", folder / "line_of_sight.argos"
    script.write_text(CONTROLLER.format(alone=alone, sighted=sighted, radius_cm=100.0 * RADIUS_M), encoding="utf-8")
    configuration.write_text(
        CONFIGURATION.format(
            length_s=f"{ticks * DT_S:g}",
            rate=round(1.0 / DT_S),
            script=script,
            arena_m=f"{size_m + 0.2:.4g}",
            half_m=f"{0.5 * size_m + 0.05:.4g}",
            inner_m=f"{0.5 * size_m - 2.0 * RADIUS_M:.4g}",
            robots=robots,
            cells=max(1, math.floor(size_m)),
        ),
        encoding="utf-8",
    )
    return configuration


def processor_s(configuration: Path) -> float:
    """Return the processor time of one experiment [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["argos3", "-z", "-n", "-c", str(configuration)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Run an experiment of one tick and one of all ticks: the difference is the cost of the ticks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", type=int)
    parser.add_argument("ticks", type=int)
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write both files here, and keep them")
    options = parser.parse_args()
    if options.keep is None and shutil.which("argos3") is None:
        sys.exit("argos_swarm: argos3 is not installed; --keep DIR writes its files only")
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if shutil.which("argos3") is None:
            print(files(folder, options.robots, options.ticks))
            return
        start_s = processor_s(files(folder, options.robots, 1))
        whole_s = processor_s(files(folder, options.robots, options.ticks))
        print(json.dumps({"rate": options.robots * (options.ticks - 1) / (whole_s - start_s)}))


if __name__ == "__main__":
    main()

"""Does the middleware lose anything? Millions of messages over real Zenoh, each with a sequence number that is checked.

The tick is the sequence number: a node answers each observation with the tick it carries, the world accepts an answer only
for the tick it is at, and goes on only when all have come. So a run that ends has lost nothing, duplicated nothing and
reordered nothing; this counts how many messages that was, both ways.
"""

import argparse

from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.run.assembly import assemble
from zwerm.run.runner import drive, new_run_id
from zwerm.scenario.load import load


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--messages", type=float, default=10e6)
    parser.add_argument("--robots", type=int, default=50)
    options = parser.parse_args()
    ticks = int(options.messages / 2 / options.robots) + 1
    scenario = load("computation-free-scaling", (f"robots.count={options.robots}", f"time.duration_s={ticks * 0.1}"))
    with LocalSwarm(new_run_id(), node_specs(scenario, 1)) as swarm:
        result = drive(assemble(scenario, 1), swarm.link, 1, "processes")
        turned_away = swarm.link.refused.total()
    print(
        f"outcome {result.outcome} after {result.wall_s:,.0f} s, {result.robot_ticks / result.wall_s:,.0f} robot-ticks/s"
    )
    print(f"{2 * result.robot_ticks:,} messages: {result.robot_ticks:,} observations and as many commands")
    print(
        f"lost {result.middleware_lost}, duplicated or out of order {sum(result.refused.values())}, refused {turned_away}"
    )
    if result.middleware_lost or result.refused or turned_away or not result.ok:
        raise SystemExit("the middleware lost messages")


if __name__ == "__main__":
    main()

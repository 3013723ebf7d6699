"""Messages lost by the middleware: millions of messages over Zenoh, each with a checked sequence number.

The tick is the sequence number. A node answers each observation with its tick; the world accepts answers of the current tick
only, and continues when all have arrived. So a run that ends has lost, duplicated and reordered no message. Prints the number
of messages in both directions.
"""

import argparse

from benchmarks.common.csv_rows import add_csv_option, write_csv
from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.run.assembly import assemble
from zwerm.run.runner import drive, new_run_id
from zwerm.scenario.load import load


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--messages", type=float, default=10e6)
    parser.add_argument("--robots", type=int, default=50)
    add_csv_option(parser)
    options = parser.parse_args()
    ticks = int(options.messages / 2 / options.robots) + 1
    scenario = load("computation-free-scaling", (f"robots.count={options.robots}", f"time.duration_s={ticks * 0.1}"))
    with LocalSwarm(new_run_id(), node_specs(scenario, 1)) as swarm:
        result = drive(assemble(scenario, 1), swarm.link, 1, "processes")
        turned_away = swarm.link.refusals.by_reason.total()
    print(
        f"outcome {result.outcome} after {result.wall_s:,.0f} s, {result.robot_ticks / result.wall_s:,.0f} robot-ticks/s"
    )
    print(f"{2 * result.robot_ticks:,} messages: {result.robot_ticks:,} observations and as many commands")
    print(
        f"lost {result.middleware_lost}, duplicated or out of order {sum(result.refused.values())}, refused {turned_away}"
    )
    row = {
        "messages": 2 * result.robot_ticks,
        "lost": result.middleware_lost,
        "duplicated or out of order": sum(result.refused.values()),
        "refused": turned_away,
    }
    write_csv(options.csv, [{name: f"{count}" for name, count in row.items()}])
    if result.middleware_lost or result.refused or turned_away or not result.ok:
        raise SystemExit("the middleware lost messages")


if __name__ == "__main__":
    main()

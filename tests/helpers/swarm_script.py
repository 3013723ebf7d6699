"""A program with a swarm in it, for tests that end it from outside: prints `joined`, and drives its robots until then.

python swarm_script.py COUNT CONTROLLER [CONTROLLER_OF_ROBOT_0]
"""

import sys

from zwerm.agents.runtime.contract import Setup
from zwerm.deploy.swarm import LocalSwarm
from zwerm.wire.messages import Observation, encode


def say(what: object, *_: object) -> None:
    sys.stdout.write(f"{what}\n")
    sys.stdout.flush()


def main(count: int, controller: str, first: str) -> None:
    members = {node: (controller if node else first, Setup(node, "robot", 0.1, (), bytes(16))) for node in range(count)}
    with LocalSwarm("script", members, progress=say) as swarm:
        say("joined")
        tick = 0
        while True:
            for node in members:
                swarm.link.send(node, encode(Observation(tick, 0.0)))
            for _ in members:
                swarm.link.receive(3_600.0)
            tick += 1


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[-1])

"""What the server that robots are forked from loads first: importing this module prepares the calling process for it.

Robots share the server's memory as long as nobody writes to it. So whatever a robot imports is imported here, once,
and the garbage collector, which writes to all it looks at, is told to leave that alone. For the server only, never for
the world.
"""

import gc

import msgspec  # noqa: F401
import numpy  # noqa: F401
import zenoh  # noqa: F401

from zwerm.agents.runtime.process import die_with_parent, serve_robots
from zwerm.catalogue import controller_classes

die_with_parent()
serve_robots()
for path in controller_classes():
    __import__(path.partition(":")[0])
gc.collect()
gc.freeze()

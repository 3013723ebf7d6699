"""Modules that the fork server of the robots loads first. Importing this module prepares the calling process for
forking.

Robots share the server's memory as long as no process writes to it. So all modules that a robot imports are imported
here, once. They are also exempt from garbage collection, which would write to their pages. Memory that the imports freed
goes back to the system: robots would fill its gaps, and each gap costs a robot a copy of a page that it would share. Where
modules are compiled at import, because their bytecode is not stored, that is 0.9 MB a robot. For the server only, never
for the world.
"""

import difflib  # noqa: F401 (for hints in errors: a robot with a user of its own may not read Python's library)
import gc

import msgspec  # noqa: F401
import numpy  # noqa: F401
import zenoh  # noqa: F401

from zwerm.agents.runtime.process import die_with_parent, serve_robots
from zwerm.catalogue import controller_classes
from zwerm.deploy.heap_memory import return_freed

die_with_parent()
serve_robots()
for path in controller_classes():
    __import__(path.partition(":")[0])
gc.collect()
return_freed()
gc.freeze()

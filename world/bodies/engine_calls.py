"""Calls of the physics engine that a tick repeats: substeps, and the reading of all bodies.

pymunk's own methods cost more than the engine does for a small swarm: each call makes a structure, looks up a function by
its name and goes through lists. So the functions of the engine's library are bound here once. pymunk does not promise
their names: without them its public methods do the same.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import pymunk
from pymunk import batch

Load = tuple[batch.BodyFields, batch.Buffer]
"""Some fields, and their values for all bodies of a space, in its own order of bodies."""


class _Library(NamedTuple):
    """The names of the engine's library that are used here."""

    ffi: Any
    step: Any
    each_body: Any
    read: Any
    write: Any

    def data(self, fields: batch.BodyFields, buffer: batch.Buffer) -> Any:
        """Return the structure that `read` and `write` take. It does not keep `buffer` alive."""
        content = {"fields": fields.value, "floatArray": buffer._float_arr, "intArray": buffer._int_arr}
        return self.ffi.new("pmBatchedData *", content)


def _library() -> _Library | None:
    """Return the engine's library, or None where this pymunk lacks a name."""
    try:
        from pymunk._chipmunk_cffi import ffi, lib

        read = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
        write = ffi.addressof(lib, "pmSpaceBodySetIteratorFuncBatched")
        found = _Library(ffi, lib.cpSpaceStep, lib.cpSpaceEachBody, read, write)
        found.data(batch.BodyFields.FORCE, batch.Buffer()).floatArray.num = 0
        _ = pymunk.Space()._space
    except (ImportError, AttributeError, KeyError, TypeError):
        return None
    return found


LIBRARY: Final = _library()


def substeps(
    space: pymunk.Space, substep_s: float, loads: Sequence[Load], library: _Library | None = LIBRARY
) -> Callable[[], None]:
    """Return a function that does one substep for each of `loads`, after writing the newest values of the load.

    It is valid until a body or a shape is added to `space` or removed from it.
    """

    def public() -> None:
        for fields, buffer in loads:
            batch.set_space_bodies(space, fields, buffer)
            space.step(substep_s)

    if library is None:
        return public
    engine, step, each_body, write = space._space, library.step, library.each_body, library.write
    bound = [(buffer._float_arr, library.data(fields, buffer)) for fields, buffer in loads]
    settled = False

    def direct() -> None:
        # After a change of bodies or shapes pymunk's own method has checks to make and lists to clear, once.
        nonlocal settled
        if not settled:
            settled = True
            public()
            return
        for values, data in bound:
            values.num = 0  # the engine takes the values from here on
            each_body(engine, write, data)
            step(engine, substep_s)

    return direct


def reader(
    space: pymunk.Space, fields: batch.BodyFields, buffer: batch.Buffer, library: _Library | None = LIBRARY
) -> Callable[[], None]:
    """Return a function that reads `fields` of all bodies of `space` into `buffer`, in place of what it holds."""
    if library is None:

        def public() -> None:
            buffer.clear()
            batch.get_space_bodies(space, fields, buffer)

        return public
    engine, each_body, read = space._space, library.each_body, library.read
    floats, ints, data = buffer._float_arr, buffer._int_arr, library.data(fields, buffer)

    def direct() -> None:
        floats.num = ints.num = 0
        each_body(engine, read, data)

    return direct

"""Compiles, where it is asked for, the one module in which inline swarms spend most of their time; see docs/running.md.

`ZWERM_COMPILE=1` makes a C extension of it with mypyc, which needs mypy and a C compiler. The source stays the same, and so
does every bit of what it computes: products and sums are rounded one by one, as Python does it.
"""

import os

from setuptools import setup

COMPILED = ["zwerm/maths/cached_voronoi_cell.py"]

extensions = []
if os.environ.get("ZWERM_COMPILE") == "1":
    from mypyc.build import mypycify

    # Without the project's settings, by which mypy would check all of it.
    extensions = mypycify(["--config-file=", "--ignore-missing-imports", *COMPILED])
    for extension in extensions:
        extension.extra_compile_args.append("-ffp-contract=off")

setup(ext_modules=extensions)

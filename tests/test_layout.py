"""The layout of the project and the limits of its code: each rule is a small scan, each exception has its reason."""

import ast
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PARTS = ("agents", "world", "coordinator", "deploy", "scenarios", "studies")
LINES_MAX = 400
MODULES_MAX = 15

# Code that decides what happens in a run: these folders, and all of the core but what starts a run and tells of it.
DECIDING = ("agents", "world", "coordinator")
AROUND_THE_RUN = ("zwerm/__main__.py", "zwerm/cli/app.py", "zwerm/run/result.py", "zwerm/run/runner.py")

# (file, rule): reason. An exception that no longer excepts anything is a mistake too.
EXCEPTIONS: dict[tuple[str, str], str] = {
    ("world/drivers/lockstep.py", "wall_clock"): "the barrier's deadline ends a run with the straggler's name",
    ("world/drivers/process_control.py", "wall_clock"): "a program that does not die is reported, and not waited for",
    ("world/drivers/realtime.py", "wall_clock"): "pacing by the wall clock is what real time is",
    ("agents/conformance/purity.py", "wall_clock"): "names the clocks that the conformance kit watches; it reads none",
    (
        "agents/conformance/purity.py",
        "global_randomness",
    ): "names the random streams that the conformance kit watches; it draws from none",
    ("zwerm/link/peer_radio.py", "wall_clock"): "measures how long packets take on a real network",
    ("zwerm/twin/twin_runner.py", "wall_clock"): "the twin runs in real time, and waits until nodes have met",
    (
        "zwerm/record/recording.py",
        "wall_clock",
    ): "what was recorded goes to the disk twice a second; the run does not see it",
    (
        "zwerm/link/arrival_signal.py",
        "wall_clock",
    ): "waiting for answers has a deadline; it decides only that a node is lost",
    (
        "zwerm/run/denial_guard.py",
        "wall_clock",
    ): "measures the load of the router; it decides only whether denied operations are counted",
    ("zwerm/link/node_link.py", "wall_clock"): "joining has a deadline; observations and commands do not look at it",
}
LONG_FILES: dict[str, str] = {}


def sources(*folders: str) -> list[Path]:
    """Return every Python file of the project, or of some of its folders, each once and by its real path."""
    found = []
    for folder, folders_below, names in os.walk(ROOT):
        folders_below[:] = sorted(
            name for name in folders_below if not name.startswith(".") and name not in ("build", "dist", "site")
        )
        found += [Path(folder, name).relative_to(ROOT) for name in sorted(names) if name.endswith(".py")]
    return [path for path in found if not folders or path.parts[0] in folders]


def deciding_sources() -> list[Path]:
    return [path for path in sources("zwerm") if str(path) not in AROUND_THE_RUN] + sources(*DECIDING)


# --- the rules ------------------------------------------------------------------------------------------------------

Finding = tuple[int, str]
Rule = Callable[[ast.Module], Iterator[Finding]]


def imported(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield every module that is imported anywhere in a file, by statement or by a literal name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and dotted(node.func).rpartition(".")[2] in ("import_module", "__import__"):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, argument.value


def dotted(node: ast.AST) -> str:
    """Return `a.b.c` for such an expression; calls and subscripts within it become empty names."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return ""


def bare_imports(tree: ast.Module) -> Iterator[Finding]:
    """A part is imported as zwerm.<part>, or it would exist twice."""
    return ((line, name) for line, name in imported(tree) if name.split(".")[0] in PARTS)


def imports_beyond_the_robot(tree: ast.Module) -> Iterator[Finding]:
    """Code of a robot imports neither the world nor the coordinator nor the code that starts it.

    Nor does it import the package itself, which offers all of that under its own name.
    """
    beyond = ("world", "coordinator", "deploy", "run", "record", "view", "study", "compare", "twin", "cli")
    for line, name in imported(tree):
        if name == "zwerm" or name.startswith(tuple(f"zwerm.{part}" for part in beyond)):
            yield line, name


CLOCKS = ("time", "datetime", "timeit")


def wall_clock(tree: ast.Module) -> Iterator[Finding]:
    """Time is the observation's; a wall clock would make two runs differ."""
    yield from ((line, name) for line, name in imported(tree) if name in CLOCKS)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "time":
            yield node.lineno, ast.unparse(node)


ENTROPY = ("random", "secrets", "uuid")
KEYED_RANDOM = ("Generator", "Philox")


def global_randomness(tree: ast.Module) -> Iterator[Finding]:
    """Randomness is keyed, by zwerm.maths.keyed_random; `hash` of a string changes with PYTHONHASHSEED."""
    yield from ((line, name) for line, name in imported(tree) if name.split(".")[0] in ENTROPY)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            name = dotted(node)
            below_random = name.rpartition(".random.")[2] if name.startswith(("np.random.", "numpy.random.")) else ""
            if (below_random and below_random not in KEYED_RANDOM) or name == "os.urandom":
                yield node.lineno, name
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "hash":
            yield node.lineno, ast.unparse(node)
    yield from ((line, name) for line, name in imported(tree) if name.startswith("numpy.random."))


SET_MAKERS = ("set", "frozenset")
SET_METHODS = ("union", "intersection", "difference", "symmetric_difference", "copy")
# Functions that may iterate over a set: their result does not depend on the order.
ORDER_BLIND = ("sorted", "len", "min", "max", "any", "all", "set", "frozenset", "bool")


class SetIteration(ast.NodeVisitor):
    """Finds places where the order of a set can leak: what is a set is told from literals, calls and annotations."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self._names: set[str] = set()
        self._blind: set[int] = set()

    def check(self, tree: ast.Module) -> list[Finding]:
        for node in ast.walk(tree):
            if isinstance(node, ast.AnnAssign) and self._annotates_set(node.annotation):
                self._names.add(ast.unparse(node.target))
            elif isinstance(node, ast.arg) and node.annotation is not None and self._annotates_set(node.annotation):
                self._names.add(node.arg)
            elif isinstance(node, ast.Assign) and self._is_set(node.value):
                self._names.update(ast.unparse(target) for target in node.targets)
        self.visit(tree)
        return self.findings

    def _annotates_set(self, annotation: ast.expr) -> bool:
        base = annotation.value if isinstance(annotation, ast.Subscript) else annotation
        return dotted(base) in (*SET_MAKERS, "AbstractSet", "MutableSet", "Set")

    def _is_set(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Set | ast.SetComp):
            return True
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr | ast.BitAnd | ast.Sub | ast.BitXor):
            return self._is_set(node.left) or self._is_set(node.right)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            return node.func.attr in SET_METHODS and self._is_set(node.func.value)
        if isinstance(node, ast.Call):
            return dotted(node.func) in SET_MAKERS
        return isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node) in self._names

    def _refuse(self, node: ast.expr) -> None:
        if self._is_set(node):
            self.findings.append((node.lineno, f"order of {ast.unparse(node)}"))

    def visit_For(self, node: ast.For) -> None:
        self._refuse(node.iter)
        self.generic_visit(node)

    def visit_Starred(self, node: ast.Starred) -> None:
        self._refuse(node.value)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if dotted(node.func) in ORDER_BLIND:
            self._blind.update(id(argument) for argument in node.args)
        elif isinstance(node.func, ast.Attribute) and node.func.attr == "pop" and not node.args:
            self._refuse(node.func.value)
        elif not (isinstance(node.func, ast.Attribute) and self._is_set(node.func.value)):
            for argument in node.args:
                if dotted(node.func).rpartition(".")[2] in ORDER_TAKERS:
                    self._refuse(argument)
        self.generic_visit(node)

    def _comprehension(self, node: ast.ListComp | ast.DictComp | ast.GeneratorExp) -> None:
        if id(node) not in self._blind:
            for part in node.generators:
                self._refuse(part.iter)
        self.generic_visit(node)

    visit_ListComp = visit_DictComp = visit_GeneratorExp = _comprehension


ORDER_TAKERS = (
    *("list", "tuple", "enumerate", "iter", "zip", "map", "filter", "next", "sum", "fsum", "dict", "fromkeys", "join"),
    *("array", "asarray", "fromiter", "deque", "extend", "extendleft", "chain", "from_iterable", "OrderedDict"),
)


def set_order(tree: ast.Module) -> Iterator[Finding]:
    """The order of a set of strings changes with PYTHONHASHSEED; sort it first."""
    return iter(SetIteration().check(tree))


def violations(rule: Rule, files: list[Path]) -> list[str]:
    """Return `file:line: what` of every finding that is not excepted."""
    return [
        f"{path}:{line}: {what}"
        for path in files
        if (str(path), rule.__name__) not in EXCEPTIONS
        for line, what in rule(ast.parse((ROOT / path).read_text(encoding="utf-8")))
    ]


RULES: list[tuple[Rule, Callable[[], list[Path]]]] = [
    (bare_imports, sources),
    (imports_beyond_the_robot, lambda: sources("agents")),
    (wall_clock, deciding_sources),
    (global_randomness, deciding_sources),
    (set_order, deciding_sources),
]


@pytest.mark.parametrize(("rule", "files"), RULES, ids=lambda each: getattr(each, "__name__", ""))
def test_the_code_keeps_the_rule(rule: Rule, files: Callable[[], list[Path]]) -> None:
    scanned = files()
    assert scanned, "the scan found no files"
    assert violations(rule, scanned) == []


@pytest.mark.parametrize(
    ("rule", "planted"),
    [
        (bare_imports, "import agents.contract"),
        (bare_imports, "from world import scene"),
        (bare_imports, "import importlib\nimportlib.import_module('deploy.supervisor')"),
        (imports_beyond_the_robot, "from zwerm.world.scene import Scene"),
        (imports_beyond_the_robot, "import zwerm\nzwerm.run('x')"),
        (imports_beyond_the_robot, "from zwerm.run.runner import run"),
        (imports_beyond_the_robot, "def f():\n    from zwerm import coordinator"),
        (wall_clock, "import time"),
        (wall_clock, "from datetime import datetime"),
        (wall_clock, "asyncio.get_running_loop().time()"),
        (global_randomness, "import random"),
        (global_randomness, "from random import choice"),
        (global_randomness, "x = np.random.rand(3)"),
        (global_randomness, "x = np.random.default_rng()"),
        (global_randomness, "from numpy.random import default_rng"),
        (global_randomness, "import os\nos.urandom(8)"),
        (global_randomness, "key = hash('name')"),
        (set_order, "for x in {1, 2}: pass"),
        (set_order, "for x in set(names): pass"),
        (set_order, "ids = set(a) | set(b)\nfor x in ids: pass"),
        (set_order, "def f(ids: frozenset[int]):\n    return [x for x in ids]"),
        (set_order, "class A:\n    def f(self):\n        self.ids: set[int] = set()\n        return list(self.ids)"),
        (set_order, "ids = {1}\nfirst = ids.pop()"),
        (set_order, "total = sum({0.1, 0.2})"),
        (set_order, "pair = (*{1, 2},)"),
        (set_order, "table = {x: 0 for x in {1}.union(b)}"),
        (set_order, "a = np.array(list(set(b)))"),
    ],
)
def test_a_planted_violation_is_caught(rule: Rule, planted: str) -> None:
    assert list(rule(ast.parse(planted)))


@pytest.mark.parametrize(
    ("rule", "allowed"),
    [
        (bare_imports, "from zwerm.agents import contract"),
        (imports_beyond_the_robot, "from zwerm.maths.keyed_random import stream"),
        (wall_clock, "deadline = observation.time_s + 1.0"),
        (global_randomness, "def f(random: np.random.Generator): return random.normal()"),
        (set_order, "for x in sorted({1, 2}): pass"),
        (set_order, "ids = {1, 2}\nok = 1 in ids and all(x > 0 for x in ids)"),
        (set_order, "squares = {x * x for x in {1, 2}}"),
        (set_order, "for x in [1, 2]: pass"),
    ],
)
def test_allowed_code_is_not_reported(rule: Rule, allowed: str) -> None:
    assert list(rule(ast.parse(allowed))) == []


def test_every_exception_still_excepts_something() -> None:
    rules = {rule.__name__: rule for rule, _ in RULES}
    for (path, name), reason in EXCEPTIONS.items():
        assert reason
        assert list(rules[name](ast.parse((ROOT / path).read_text(encoding="utf-8")))), f"{path}: {name}"
    for path, reason in LONG_FILES.items():
        assert reason
        assert line_count(ROOT / path) > LINES_MAX, path


def line_count(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def test_no_file_has_more_than_400_lines_without_a_reason() -> None:
    outside = [path for path in sources() if path.parts[0] != "tests" and str(path) not in LONG_FILES]
    assert [f"{path}: {line_count(ROOT / path)} lines" for path in outside if line_count(ROOT / path) > LINES_MAX] == []


# An assertion that less wall time has passed than a bound: it fails on a loaded machine. Deadlines end a wait, and are none.
UPPER_BOUND_OF_WALL_TIME = re.compile(
    r"assert\b.*((time\.\w+\(\) - \w+|\bwall_s) *<|\bwall_s == pytest\.approx|> *(time\.\w+\(\) - \w+|[\w.]*\bwall_s\b))"
)


def test_no_folder_has_more_than_15_modules_or_pages() -> None:
    pages = [page.relative_to(ROOT) for page in (ROOT / "docs").rglob("*.md")]
    modules = sources("zwerm", *PARTS, "tests", "benchmarks", "docs")
    folders = Counter(path.parent for path in [*modules, *pages] if path.name != "__init__.py")
    assert {str(folder): count for folder, count in folders.items() if count > MODULES_MAX} == {}


def test_no_test_asserts_an_upper_bound_of_wall_time() -> None:
    found = [
        f"{path}:{number}: {line.strip()}"
        for path in sources("tests")
        if path.name != Path(__file__).name
        for number, line in enumerate((ROOT / path).read_text(encoding="utf-8").splitlines(), 1)
        if UPPER_BOUND_OF_WALL_TIME.search(line) and "end_s" not in line
    ]
    assert found == []


@pytest.mark.parametrize(
    ("line", "bounds"),
    [
        ("assert time.monotonic() - began_s < 2.0", True),
        ("assert 0.5 <= result.wall_s < 1.0", True),
        ("assert 2.0 > result.wall_s", True),
        ("assert result.wall_s == pytest.approx(1.2, abs=0.3)", True),
        ("assert time.monotonic() - began_s >= 0.2", False),
        ("assert result.wall_s >= 0.5", False),
    ],
)
def test_an_upper_bound_of_wall_time_is_recognised(line: str, bounds: bool) -> None:
    assert bool(UPPER_BOUND_OF_WALL_TIME.search(line)) is bounds


# --- the packages ---------------------------------------------------------------------------------------------------

IMPORT_ALL = """
import collections, importlib, os, pkgutil, sys, zwerm
for module in pkgutil.walk_packages(zwerm.__path__, "zwerm."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
files = collections.defaultdict(list)
for name, module in list(sys.modules.items()):
    if getattr(module, "__file__", None) and not name.endswith("__mypyc"):  # the shared part of a compiled module
        files[os.path.realpath(module.__file__)].append(name)
ours = {file: names for file, names in files.items() if file.startswith(sys.argv[1] + os.sep) and ".venv" not in file}
print(len(ours))
print(*(f"{file}: {names}" for file, names in ours.items() if len(names) > 1), sep="\\n")
"""


def test_no_module_is_imported_twice() -> None:
    run = [sys.executable, "-c", IMPORT_ALL, str(ROOT.resolve())]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    result = subprocess.run(run, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    count, *twice = result.stdout.split("\n")
    modules = [path for path in sources("zwerm", *PARTS) if path.name != "__main__.py"]
    assert int(count) == len(modules)
    assert [line for line in twice if line] == []


def test_the_parts_are_symlinks_in_the_work_tree_and_in_the_repository() -> None:
    for part in PARTS:
        assert (ROOT / "zwerm" / part).readlink() == Path("..", part)
    listing = ["git", "-c", "safe.directory=*", "ls-files", "--stage", *(f"zwerm/{part}" for part in PARTS)]
    modes = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert [line.split()[0] for line in modes] == ["120000"] * len(PARTS)


@pytest.mark.skipif(
    int(importlib.metadata.version("setuptools").split(".")[0]) < 77,
    reason="building needs setuptools 77, which `make test` installs",
)
def test_the_wheel_holds_every_package_and_scenario_exactly_once(tmp_path: Path) -> None:
    aside = shutil.ignore_patterns(".*", "build", "dist", "site", "*.egg-info", "__pycache__", "runs")
    shutil.copytree(ROOT, tmp_path / "tree", symlinks=True, ignore=aside)
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index"]
    build += ["--wheel-dir", str(tmp_path), str(tmp_path / "tree")]
    result = subprocess.run(build, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr

    (wheel,) = tmp_path.glob("zwerm-*.whl")
    held = [name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name]
    expected = [str(path) for path in sources("zwerm")] + ["zwerm/py.typed"]
    expected += [f"zwerm/{path}" for path in sources(*PARTS)]
    for part in ("scenarios", "studies"):
        data = [
            path
            for ending in ("toml", "yaml", "pgm", "json", "map", "mcpp")
            for path in (ROOT / part).rglob(f"*.{ending}")
        ]
        expected += [f"zwerm/{path.relative_to(ROOT)}" for path in data]
    assert sorted(held) == sorted(expected)

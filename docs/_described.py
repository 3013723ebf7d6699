"""The description of a public name as Markdown: its signature as it is written in the code, and its docstrings.

`pages.py` writes what `describe` returns into the pages, below the line `<!-- described: NAME -->`.
"""

import ast
import inspect
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final

Function = ast.FunctionDef | ast.AsyncFunctionDef

# A signature that is longer is written with a line for each parameter.
_LINE_MAX: Final = 100


def describe(name: str) -> str:
    """Return a module, class or function as Markdown, with the public members that have a docstring.

    Raises KeyError with a line for a name that does not exist.
    """
    try:
        found = import_module(name)
    except ImportError:
        module, _, own = name.rpartition(".")
        try:
            found = getattr(import_module(module), own)
        except (ImportError, AttributeError, ValueError):
            raise KeyError(f"there is no {name} to describe") from None
    if inspect.ismodule(found):
        return "\n\n".join((_docstring(found), *(_member(found, each) for each in _parts(found))))
    return _described(f"### `{name}`", found, _definition(found))


def _described(title: str, found: Any, node: ast.stmt) -> str:
    """Return the title, signature, docstring and members of a class or function."""
    if isinstance(node, ast.ClassDef):
        members = (each for each in node.body if isinstance(each, Function) and _is_public(each))
        parts = [title, _code(_class_text(node)), _docstring(found)]
        parts += [_method(title, node.name, each) for each in members]
        return "\n\n".join(parts)
    assert isinstance(node, Function)
    return "\n\n".join((title, _code(_function_text(node)), _docstring(found)))


def _member(module: Any, node: ast.ClassDef | Function) -> str:
    return _described(f"### `{node.name}`", getattr(module, node.name), node)


def _method(title: str, owner: str, node: Function) -> str:
    level = title.partition(" ")[0]
    return "\n\n".join((f"{level}# `{owner}.{node.name}`", _code(_function_text(node)), _text(ast.get_docstring(node))))


def _parts(module: Any) -> list[ast.ClassDef | Function]:
    """Return the public classes and functions of a module that have a docstring."""
    nodes = _tree(module.__file__).body
    return [each for each in nodes if isinstance(each, ast.ClassDef | Function) and _is_public(each)]


def _is_public(node: ast.ClassDef | Function) -> bool:
    return not node.name.startswith("_") and bool(ast.get_docstring(node))


def _definition(found: Any) -> ast.stmt:
    """Return the statement that defines a class or a function."""
    own = inspect.unwrap(found)
    for node in _tree(inspect.getsourcefile(own) or "").body:
        if isinstance(node, ast.ClassDef | Function) and node.name == own.__name__:
            return node
    raise KeyError(f"{own.__module__} does not define {own.__name__}")


@cache
def _tree(file: str) -> ast.Module:
    return ast.parse(Path(file).read_text(encoding="utf-8"))


def _class_text(node: ast.ClassDef) -> str:
    """Return the head of a class, with its decorators and public fields."""
    fields = [
        f"    {ast.unparse(each)}"
        for each in node.body
        if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name) and each.target.id[0] != "_"
    ]
    inside = ", ".join(ast.unparse(each) for each in (*node.bases, *node.keywords))
    return "\n".join([*_decorators(node), f"class {node.name}({inside})" if inside else f"class {node.name}", *fields])


def _function_text(node: Function) -> str:
    """Return the head of a function, with its decorators."""
    result = "" if node.returns is None else f" -> {ast.unparse(node.returns)}"
    start, arguments = f"{'async ' if isinstance(node, ast.AsyncFunctionDef) else ''}def {node.name}", node.args
    line = f"{start}({ast.unparse(arguments)}){result}"
    if len(line) > _LINE_MAX:
        line = f"{start}(\n{_lines(arguments)}\n){result}"
    return "\n".join([*_decorators(node), line])


def _decorators(node: ast.ClassDef | Function) -> list[str]:
    return [f"@{ast.unparse(each)}" for each in node.decorator_list]


def _lines(arguments: ast.arguments) -> str:
    """Return the parameters of a function, one a line."""
    parts = []
    plain = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(plain) - len(arguments.defaults)) + list(arguments.defaults)
    for each, default in zip(plain, defaults, strict=True):
        parts.append(_parameter(each, default))
        if arguments.posonlyargs and each is arguments.posonlyargs[-1]:
            parts.append("/")
    if arguments.vararg is not None:
        parts.append(f"*{ast.unparse(arguments.vararg)}")
    elif arguments.kwonlyargs:
        parts.append("*")
    parts += [_parameter(*each) for each in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)]
    if arguments.kwarg is not None:
        parts.append(f"**{ast.unparse(arguments.kwarg)}")
    return "\n".join(f"    {each}," for each in parts)


def _parameter(parameter: ast.arg, default: ast.expr | None) -> str:
    return ast.unparse(parameter) + ("" if default is None else f" = {ast.unparse(default)}")


def _code(text: str) -> str:
    return f"```py\n{text}\n```"  # not `python`, which tests run


def _docstring(found: Any) -> str:
    return _text(found.__doc__)


def _text(docstring: str | None) -> str:
    return inspect.cleandoc(docstring or "")

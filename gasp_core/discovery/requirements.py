"""Whether an engine's own code could be imported, told from metadata and source: nothing of it is imported."""

from __future__ import annotations

import ast
import importlib.machinery
import importlib.metadata
import importlib.util
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["missing_factory", "missing_requirements", "source_fault"]

_REQUIREMENT_NAME = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9._-]*)")


def missing_requirements(distribution: str) -> list[str]:
    """Requirements of an installed distribution that are not installed, as written there, e.g. "taichi>=1.7.3".

    Only presence is looked at, not versions. Requirements with an environment marker are passed over: they may be
    meant for another platform or an extra that nobody asked for.
    """
    try:
        requirements = importlib.metadata.requires(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    missing: list[str] = []
    for requirement in requirements:
        name = _REQUIREMENT_NAME.match(requirement)
        if ";" in requirement or name is None:
            continue
        try:
            importlib.metadata.distribution(name.group(1))
        except importlib.metadata.PackageNotFoundError:
            missing.append(requirement.replace(" ", ""))
    return missing


def missing_factory(factory: str) -> str | None:
    """The module of a factory "package.module:attribute" if it cannot be found, else None.

    Looked up only where that imports nothing new: below a package that is not imported yet, only the package is.
    """
    module = factory.partition(":")[0]
    package = module.partition(".")[0]
    parent = module.rpartition(".")[0]
    wanted = module if not parent or parent in sys.modules else package
    try:
        found = wanted in sys.modules or importlib.util.find_spec(wanted) is not None
    except (ImportError, ValueError):
        found = False
    return None if found else wanted


def source_fault(factory: str) -> str | None:
    """Why a factory "package.module:attribute" cannot be in its module, read from the source; None where it may be.

    Code that makes names in ways that reading does not show, `from x import *` or `globals()`, is given the benefit of
    the doubt; so is a module that cannot be found without an import.
    """
    module, _, attribute = factory.partition(":")
    name = attribute.partition(".")[0]
    absent = f"its module {module} has no {name}, which the plugin names as its factory"
    if module in sys.modules:
        known = vars(sys.modules[module])
        return None if name in known or "__getattr__" in known else absent
    path = _source_of(module)
    if path is None:
        return None
    try:
        tree = ast.parse(path.read_bytes(), path)
    except OSError:
        return None
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None)
        where = f"line {line} of {path}" if line is not None else str(path)
        return f"its module {module} is no Python: {getattr(error, 'msg', error)}, {where}"
    return None if _makes_names_unseen(tree) or name in set(_names(tree.body)) else absent


def _source_of(module: str) -> Path | None:
    """The source file of a module that is found without importing anything."""
    parent = module.rpartition(".")[0]
    if parent and parent not in sys.modules:
        return None
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.origin is None or not isinstance(spec.loader, importlib.machinery.SourceFileLoader):
        return None
    return Path(spec.origin)


def _names(statements: Iterable[ast.stmt]) -> Iterator[str]:
    """Names that statements at the top of a module bind; some more, where definitions lie within a branch."""
    for statement in statements:
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield statement.name
            nodes = [node for node in ast.walk(statement) if isinstance(node, ast.Global)]
        else:
            nodes = list(ast.walk(statement))
        for node in nodes:
            match node:
                case ast.Name(id=name, ctx=ast.Store()):
                    yield name
                case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                    yield name
                case ast.alias(name=name, asname=other):
                    yield other or name.partition(".")[0]
                case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)) | ast.ExceptHandler(name=str(name)):
                    yield name
                case ast.Global(names=names):
                    yield from names
                case _:
                    pass


def _makes_names_unseen(tree: ast.Module) -> bool:
    """Whether a module may bind names that `_names` does not see."""
    unseen = {"globals", "vars", "locals", "exec", "setattr", "__dict__", "modules", "__getattr__"}
    for node in ast.walk(tree):
        match node:
            case ast.alias(name="*"):
                return True
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.FunctionDef(name=name) if name in unseen:
                return True
            case _:
                pass
    return False

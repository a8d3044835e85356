"""Finding a Python of the version that an engine's environment asks for."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from packaging.specifiers import InvalidSpecifier, SpecifierSet

from gasp_core.errors import EngineEnvironmentError

__all__ = ["find_python", "version_of", "wanted_versions"]

_OLDEST_MINOR, _NEWEST_MINOR = 11, 20
"""Of Python 3: what the contract runs under, and as far as one looks ahead."""
_PATIENCE = 30.0


def wanted_versions(python: str) -> SpecifierSet:
    """The versions that `EngineEnvironment.python` stands for: "3.11" for any 3.11, or a range ">=3.11,<3.14".

    Raises
    ------
    EngineEnvironmentError
        Where it is neither.
    """
    try:
        if not python.strip():
            raise InvalidSpecifier
        return SpecifierSet(f"=={python}.*" if python[:1].isdigit() else python)
    except InvalidSpecifier:
        raise EngineEnvironmentError(
            f'an environment for Python "{python}": must be a version such as 3.11 or a range such as >=3.11,<3.14'
        ) from None


def find_python(python: str) -> Path:
    """An interpreter of a wanted version: this one, else the newest on the PATH, else one that uv knows of.

    Raises
    ------
    EngineEnvironmentError
        Where there is none.
    """
    wanted = wanted_versions(python)
    for candidate in _candidates(wanted, python):
        version = version_of(candidate)
        if version is not None and fits(version, wanted):
            return candidate
    raise EngineEnvironmentError(
        f"no Python {python} found: install one (e.g. uv python install {_example(wanted, python)}),"
        " or give its path with --python"
    )


def fits(version: str, wanted: SpecifierSet) -> bool:
    """Whether a version is among the wanted ones and new enough for the contract."""
    return wanted.contains(version, prereleases=True) and tuple(map(int, version.split(".")[:2])) >= (3, _OLDEST_MINOR)


def version_of(interpreter: Path) -> str | None:
    """The version of an interpreter, e.g. "3.11.7"; None where it does not run."""
    return _said(str(interpreter), "-I", "-c", "import platform; print(platform.python_version().split('+')[0])")


def _candidates(wanted: SpecifierSet, python: str) -> Iterator[Path]:
    yield Path(sys.executable)
    for minor in range(_NEWEST_MINOR, _OLDEST_MINOR - 1, -1):
        found = shutil.which(f"python3.{minor}")
        # A shim of a version manager is there and may still not run; that is seen when it is asked for its version.
        if found:
            yield Path(found)
    for name in ("python3", "python"):
        found = shutil.which(name)
        if found:
            yield Path(found)
    uv = shutil.which("uv")
    found = _said(uv, "python", "find", python) if uv else None
    if found:
        yield Path(found)


def _said(*command: str) -> str | None:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=_PATIENCE, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None


def _example(wanted: SpecifierSet, python: str) -> str:
    minors = range(_NEWEST_MINOR, _OLDEST_MINOR - 1, -1)
    return next((f"3.{minor}" for minor in minors if wanted.contains(f"3.{minor}.0")), python)

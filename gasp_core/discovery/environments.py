"""What is there of an engine's environment: nothing, what its plugin asks for, or something else."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import Enum
from pathlib import Path

from gasp_core.contract import EngineDescriptor, EngineEnvironment
from gasp_core.discovery.data_folder import environments_folder
from gasp_core.errors import EngineEnvironmentError

__all__ = ["EnvironmentState", "environment_fault", "folder_of", "python_in", "ready_python", "stamp", "state_of"]

_STAMP = "gasp-environment.json"
_LAYOUT = 1
"""Of what is installed besides the backend; an environment of another one is built anew."""


class EnvironmentState(Enum):
    """Of an environment on this machine."""

    READY = "ready"
    MISSING = "not installed"
    OUTDATED = "outdated"
    """Built for other packages than the plugin asks for now, or its Python is gone."""


def folder_of(descriptor: EngineDescriptor) -> Path:
    """Where the environment of an engine is, or would be."""
    return environments_folder() / descriptor.name


def python_in(folder: Path) -> Path:
    """The interpreter of an environment."""
    return folder / "bin" / "python"


def stamp(folder: Path, environment: EngineEnvironment) -> None:
    """Note in a finished environment what it was built for."""
    (folder / _STAMP).write_text(json.dumps(_asked(environment), indent=2) + "\n", encoding="utf-8")


def state_of(descriptor: EngineDescriptor) -> EnvironmentState:
    """The state of the environment an engine declares; nothing is run."""
    folder = folder_of(descriptor)
    if not folder.is_dir():
        return EnvironmentState.MISSING
    try:
        found: object = json.loads((folder / _STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    sound = descriptor.environment is not None and found == _asked(descriptor.environment)
    return EnvironmentState.READY if sound and python_in(folder).exists() else EnvironmentState.OUTDATED


def environment_fault(descriptor: EngineDescriptor) -> str | None:
    """What keeps the environment of an engine from being used and what to do, in one line; None where nothing does."""
    state = state_of(descriptor)
    if state is EnvironmentState.READY:
        return None
    what = {
        EnvironmentState.MISSING: "the environment it runs in is not installed",
        EnvironmentState.OUTDATED: "the environment it runs in is not what it asks for any more",
    }[state]
    return f"{what}: gasp engines install {descriptor.name}"


def ready_python(descriptor: EngineDescriptor) -> Path:
    """The interpreter of an engine's environment.

    Raises
    ------
    EngineEnvironmentError
        Where the environment is missing or outdated.
    """
    fault = environment_fault(descriptor)
    if fault is not None:
        raise EngineEnvironmentError(f'engine "{descriptor.name}": {fault}')
    return python_in(folder_of(descriptor))


def _asked(environment: EngineEnvironment) -> dict[str, object]:
    return {**asdict(environment), "packages": list(environment.packages), "layout": _LAYOUT}

"""psi as a Python function."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError
from gasp_core.scene.motions import PythonMotion

__all__ = ["CallableMotion", "function_digest", "load_function"]

Array = NDArray[Any]
Function = Callable[[Any, float], Any]


def load_function(text: str | Function) -> Function:
    """The function that "module:function" names; a module that ends in ".py" is a file.

    Raises
    ------
    SceneError
        Where there is none, or its module fails.
    """
    if not isinstance(text, str):
        return text
    name, _, attribute = text.rpartition(":")
    try:
        module = _module_of(Path(name)) if name.endswith(".py") else importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise SceneError(f"motion {text}: cannot be imported: {_said(error)}") from error
    function = getattr(module, attribute, None)
    if not callable(function):
        raise SceneError(f"motion {text}: {name} has no function {attribute}")
    return function


def function_digest(text: str | Function) -> str:
    """SHA-256 of the file the function is in, so that a run is not gone on with after a change; of its name else."""
    function = load_function(text)
    try:
        content = Path(inspect.getsourcefile(function) or "").read_bytes()
    except (OSError, TypeError):
        content = b""
    return hashlib.sha256(repr(getattr(function, "__qualname__", "")).encode() + content).hexdigest()


class CallableMotion:
    """A function of the simplices at rest and the scene time, whatever it does inside.

    Parameters
    ----------
    choice
        Names the function, its span and step.
    rest : (N, V, 3)
        Simplices in the frame and unit of the file.
    """

    def __init__(self, choice: PythonMotion, rest: Array) -> None:
        self._function = load_function(choice.function)
        self._name = choice.function if isinstance(choice.function, str) else repr(choice.function)
        self._rest = rest
        self.span = choice.span or (-math.inf, math.inf)
        self.step = choice.step

    def __len__(self) -> int:
        return len(self._rest)

    def simplices(self, time: float) -> Array:
        """See `SceneMotion`."""
        where = f"motion {self._name} at scene time {time:g} s"
        try:
            # A copy each time: functions like to work in place.
            moved = np.array(self._function(self._rest.copy(), time), dtype=np.float64)
        except (Exception, SystemExit) as error:
            raise SceneError(f"{where}: {_said(error)}") from error
        if moved.shape != self._rest.shape:
            raise SceneError(f"{where}: gave an array of shape {moved.shape}, expected {self._rest.shape}")
        return moved


def _module_of(path: Path) -> Any:
    name = f"_gasp_motion_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up by name.
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _said(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__

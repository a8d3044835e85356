"""Every error a user of GASP is meant to see.

Each message says what went wrong, where, and what to do about it, in one line: the command line prints it
behind ``gasp: `` and exits with status 2, never with a traceback.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

__all__ = [
    "AccuracyError",
    "BackendError",
    "DuplicateEngineError",
    "EngineCrashedError",
    "EngineDivergedError",
    "EngineEnvironmentError",
    "GaspError",
    "PluginLoadError",
    "RecordingError",
    "RenderingError",
    "SceneError",
    "SplatFormatError",
    "UnknownEngineError",
    "UnsupportedSceneError",
]


class GaspError(Exception):
    """Base of all errors raised on purpose by GASP."""


class PluginLoadError(GaspError):
    """A plugin was found but could not be imported or registered."""


class DuplicateEngineError(GaspError):
    """Two installed plugins offer an engine of the same name."""


class UnknownEngineError(GaspError):
    """No installed plugin offers the engine that was asked for."""


class SceneError(GaspError):
    """A scene, or a part of one, is malformed or physically impossible."""


class SplatFormatError(GaspError):
    """A splat file cannot be read or written as the format it claims to be."""


class UnsupportedSceneError(GaspError):
    """The scene needs something the chosen engine does not declare."""


class BackendError(GaspError):
    """There is nobody who could make the runs that were asked for: no scheduler, no workers, no package."""


class EngineDivergedError(GaspError):
    """A simulation stopped because its state is no longer credible.

    Parameters
    ----------
    message
        What happened, in which frame, and what to try.
    report
        The step report of the contract that carried the verdict. Untyped here: the contract raises errors, and so
        stands above them.
    recording
        Where the frames up to the last good one are kept; None if nothing was recorded.
    """

    def __init__(self, message: str, report: Any, recording: Path | None = None) -> None:
        super().__init__(message)
        self.report = report
        self.recording = recording


class EngineCrashedError(GaspError):
    """The process an engine ran in died, hung, or failed in a way that no engine should.

    Parameters
    ----------
    message
        What happened, and where its log is.
    recording
        Where the frames up to there are kept; None if nothing was recorded.
    """

    def __init__(self, message: str, recording: Path | None = None) -> None:
        super().__init__(message)
        self.recording = recording


class EngineEnvironmentError(GaspError):
    """The environment an engine needs is missing or broken."""


class RecordingError(GaspError):
    """A recording cannot be opened, continued or written."""


class RenderingError(GaspError):
    """A picture or film cannot be made, or pictures cannot be compared."""


class AccuracyError(GaspError):
    """An error cannot be measured: recordings that do not belong together, or a truth that is none."""

"""What only this engine has."""

from __future__ import annotations

from dataclasses import dataclass

from gasp_core.errors import SceneError

__all__ = ["TaichiOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TaichiOptions:
    """Options of the Taichi engine.

    Parameters
    ----------
    threads
        Processors to use on the CPU; 0 for all of them (one, where the cloud is too small to gain from more).
        Results are the same, bit for bit, for any number.
    """

    threads: int = 0

    def __post_init__(self) -> None:
        if isinstance(self.threads, bool) or not isinstance(self.threads, int) or self.threads < 0:
            raise SceneError(f"TaichiOptions.threads must be a whole number >= 0, found {self.threads!r}")

"""What only this engine has."""

from __future__ import annotations

from dataclasses import dataclass

from gasp_core.errors import SceneError

__all__ = ["WarpOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class WarpOptions:
    """Options of the Warp engine.

    Parameters
    ----------
    threads
        Processors to use on the CPU, with the same results bit for bit for any number; 0 for all of them, or one
        where the cloud is too small to gain from more.
    """

    threads: int = 0

    def __post_init__(self) -> None:
        if type(self.threads) is not int or self.threads < 0:
            raise SceneError(f"WarpOptions.threads must be a whole number >= 0, found {self.threads!r}")

"""What commands that run a scene may set instead of what it says itself; the same words for all of them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from gasp_core.contract import Precision
    from gasp_core.scene.model import Scene

__all__ = ["PRECISIONS", "Settings", "device_option", "set_option", "settings_options", "share"]

PRECISIONS = ("float32", "float64")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Instead of the scene's; None: as it says.

    Parameters
    ----------
    resolution
        Cells along the largest body.
    device, precision
        Of the engine.
    cores
        A share of the Gaussians below 1 or with a point in it, a number of cores, or "all" for every vertex.
    changes
        Keys of the scene file that are set, "object.plant.height=0.3".
    """

    resolution: int | None = None
    device: str | None = None
    precision: Precision | None = None
    cores: float | int | str | None = None
    changes: tuple[str, ...] = ()

    def load(self, path: Path) -> Scene:
        """The scene of a file as it is to be run; device and precision go with the engine that is chosen."""
        from gasp_core import load_scene

        scene = load_scene(path, self.changes)
        if self.resolution is not None:
            scene = scene.with_resolution(self.resolution)
        if isinstance(self.cores, int):
            scene = scene.with_cores(count=self.cores)
        elif self.cores is not None:
            scene = scene.with_cores(fraction=self.cores if isinstance(self.cores, float) else None)
        return scene

    def words(self) -> list[str]:
        """The options that say so, for a command that is to be given again."""
        given = {
            "--resolution": self.resolution,
            "--device": self.device,
            "--precision": None if self.precision is None else self.precision.value,
            "--cores": self.cores,
        }
        words = [word for name, value in given.items() if value is not None for word in (name, str(value))]
        return words + [word for change in self.changes for word in ("--set", change)]


def share(word: str) -> float:
    """A number above 0 up to 1; ValueError where it is none."""
    number = float(word)
    if not 0 < number <= 1:
        raise ValueError
    return number


class _Cores(click.ParamType[Any]):
    name = "cores"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        word = str(value)
        if word == "all":
            return word
        try:
            # Digits alone are a number, so that 1 is one core and 1.0 all of them.
            return int(word) if word.isdecimal() and int(word) > 0 else share(word)
        except ValueError:
            self.fail(f'"{word}" is not a share above 0 up to 1, a whole number, or "all"', param, ctx)


device_option = click.option("--device", metavar="NAME", help='Of the engine, e.g. cuda; "gasp engines" lists them.')
set_option = click.option(
    "--set",
    "changes",
    metavar="KEY=VALUE",
    multiple=True,
    help="Instead of what the scene file says, e.g. object.plant.height=0.3; more than one if you like.",
)


def settings_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options, and what they say as its argument `settings`."""

    @functools.wraps(command)
    def with_settings(
        *args: Any,
        resolution: int | None,
        device: str | None,
        precision: str | None,
        cores: Any,
        changes: tuple[str, ...],
        **others: Any,
    ) -> None:
        from gasp_core.contract import Precision

        settings = Settings(
            resolution=resolution,
            device=device,
            precision=None if precision is None else Precision(precision),
            cores=cores,
            changes=changes,
        )
        command(*args, settings=settings, **others)

    options = (
        click.option(
            "--resolution", metavar="N", type=click.IntRange(2, 4096), help="Cells across the largest object."
        ),
        device_option,
        click.option("--precision", type=click.Choice(PRECISIONS), help="Of the engine's numbers."),
        click.option(
            "--cores",
            metavar="SHARE|N|all",
            type=_Cores(),
            help='Clusters that stand for the Gaussians: a share, 0.1, or a number, 5000; "all": every vertex.',
        ),
        set_option,
    )
    return functools.reduce(lambda wrapped, option: option(wrapped), reversed(options), with_settings)

"""``gasp tradeoff``: error against time of a scene, over the settings that decide both."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.backends import Makers, makers_options
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import overwrite_option
from gasp_core.cli.printing import print_json, print_table
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.settings import PRECISIONS, device_option, set_option, share
from gasp_core.cli.trust_code import code_is_trusted, trust_code_option

if TYPE_CHECKING:
    from gasp_core.studies.tradeoff import Tradeoff

__all__ = ["tradeoff"]


class Several(click.ParamType[tuple[Any, ...]]):
    """Values with commas between them."""

    def __init__(self, name: str, read: Callable[[str], Any], allowed: str) -> None:
        self.name = name
        self._read = read
        self._allowed = allowed

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        """The values, each once."""
        if isinstance(value, tuple):
            return value
        found: list[Any] = []
        for word in str(value).split(","):
            try:
                found.append(self._read(word.strip()))
            except ValueError:
                self.fail(f'must be {self._allowed} with commas between them, found "{word.strip()}"', param, ctx)
        return tuple(dict.fromkeys(found))


def _resolution(word: str) -> int:
    number = int(word)
    if not 2 <= number <= 4096:
        raise ValueError
    return number


def _cores(word: str) -> float | None:
    return None if word == "all" else share(word)


def _precision(word: str) -> str:
    if word not in PRECISIONS:
        raise ValueError
    return word


@click.command(
    epilog="""\b
Examples:
  gasp tradeoff scene.toml
  gasp tradeoff scene.toml --engine taichi-mpm --resolutions 16,24,32,48
  gasp tradeoff scene.toml --fractions all,0.3,0.1,0.03 --precisions float32 --repeats 9
  gasp tradeoff scene.toml --set scene.duration=0.5
  gasp tradeoff bar.toml --substep-fractions 0.25,0.5,0.9 --truth bar.py:position

\b
A truth of your own is a function in a Python file:
  def position(points, time):   # (M, 3) metres at the start, seconds
      return ...                # (M, 3) metres at that time

\b
FRONT marks the settings that no other one beats in both error and time.
"""
)
@click.argument("scene", type=PathHere())
@click.option("--engine", metavar="NAME", help='Engine to use instead of the scene\'s; "gasp engines" lists them.')
@device_option
@set_option
@click.option(
    "--resolutions",
    metavar="N,N,..",
    type=Several("resolutions", _resolution, "whole numbers from 2 to 4096"),
    help="Cells across the largest object. [default: the scene's own, and it over 1.4 and over 2]",
)
@click.option(
    "--fractions",
    metavar="F,F,..",
    type=Several("fractions", _cores, 'numbers above 0 up to 1, or "all",'),
    default="all,0.1",
    show_default=True,
    help='Cores for each Gaussian; "all": every vertex.',
)
@click.option(
    "--precisions",
    metavar="P,P",
    type=Several("precisions", _precision, "float32 or float64"),
    help="Of the engine's numbers. [default: all it has]",
)
@click.option(
    "--substep-fractions",
    metavar="F,F,..",
    type=Several("substep fractions", share, "numbers above 0 up to 1"),
    help="Of the largest stable substep. [default: the scene's own]",
)
@click.option(
    "--repeats",
    metavar="N",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Timed runs of each setting, after one that warms up; 9 or more give intervals to rely on.",
)
@click.option("--truth", metavar="FILE.py:FUNCTION", help="Closed form. [default: a run 1.5 times finer]")
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=PathHere(),
    help="Where table and plot go. [default: the scene's name with .tradeoff, in the current folder]",
)
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Of the order of the runs.")
@makers_options("Runs at a time; times are not those of a run alone then. [default: 1]")
@most_memory_option
@trust_code_option
@click.option("--keep", is_flag=True, help="Keep a recording of each setting, and the truth's.")
@overwrite_option("a result")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and no progress.")
def tradeoff(
    scene: Path,
    engine: str | None,
    device: str | None,
    changes: tuple[str, ...],
    resolutions: tuple[int, ...] | None,
    fractions: tuple[float | None, ...],
    precisions: tuple[str, ...] | None,
    substep_fractions: tuple[float, ...] | None,
    repeats: int,
    truth: str | None,
    out: Path | None,
    seed: int,
    makers: Makers,
    keep: bool,
    overwrite: bool,
    trust_code: bool,
    as_json: bool,
) -> None:
    """Measure error against time, and say which settings are worth it.

    SCENE is run with every combination of the settings, each run in a process of its own, in random order. Times hold
    for this machine alone; errors for all.
    """
    from gasp_core import load_scene
    from gasp_core.contract import Precision
    from gasp_core.discovery.registry import discover
    from gasp_core.studies.tradeoff import default_resolutions, grid, load_truth
    from gasp_core.studies.tradeoff import tradeoff as measured

    loaded = load_scene(scene, changes)
    descriptor = discover().descriptor(engine or loaded.engine.name)
    if resolutions is None and loaded.accuracy.spacing is not None:
        raise click.UsageError("the scene names a spacing, which fixes its resolution: say --resolutions")
    folder = out if out is not None else Path(scene.stem + ".tradeoff")
    jobs = makers.jobs or 1
    backend = makers.chosen(jobs)
    trusted = code_is_trusted(loaded, trust_code)
    result = measured(
        loaded,
        grid(
            resolutions or default_resolutions(loaded),
            fractions,
            [Precision(word) for word in precisions] if precisions else descriptor.capabilities.precisions,
            substep_fractions or (loaded.accuracy.substep_fraction,),
        ),
        folder,
        engine=engine,
        device=device,
        name=scene.stem,
        repeats=repeats,
        truth=load_truth(truth) if truth is not None else None,
        seed=seed,
        keep=keep,
        overwrite=overwrite,
        trust_code=trusted,
        limits=makers.limits(jobs),
        backend=backend,
        progress=False if as_json else None,
    )
    if as_json:
        print_json(result.to_json())
    else:
        _print_for_people(result, folder)


def _print_for_people(result: Tradeoff, folder: Path) -> None:
    from gasp_core.studies.tradeoff.report import HEADER

    width = len(HEADER)
    whole = [cells for cells in result.table() if len(cells) == width]
    print_table(HEADER, whole)
    for cells in result.table():
        if len(cells) < width:
            click.echo("  ".join(cells))
    for note in result.notes:
        click.echo(note)
    click.echo(f"{result.truth['sentence']}; times are those of this machine")
    click.echo(f"{folder}: tradeoff.png, tradeoff.svg, tradeoff.csv, tradeoff.json")

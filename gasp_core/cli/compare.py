"""``gasp compare``: one scene through several engines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.backends import Makers, makers_options
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import overwrite_option
from gasp_core.cli.picture_size import Size
from gasp_core.cli.printing import print_json, print_table
from gasp_core.cli.run_path import PathHere, keep_at_option
from gasp_core.cli.settings import Settings, settings_options
from gasp_core.cli.trust_code import code_is_trusted, trust_code_option

if TYPE_CHECKING:
    from gasp_core.studies.comparison import Comparison, Pair, Row

__all__ = ["compare"]


@click.command(
    epilog="""\b
Examples:
  gasp compare scene.toml                              every engine that is ready
  gasp compare scene.toml --engines warp-mpm,mujoco-flex --resolution 24
  gasp compare scene.toml --time-limit 600 --out look
  gasp compare scene.toml --json | jq '.engines[] | {engine, status, run_seconds}'

\b
An engine that cannot do the scene, or crashes, is a row with its reason; the
others go on. Exit status: 0 where at least one engine came to the end, else 2.
Open comparison.html in a browser: tables, films side by side, plots.
"""
)
@click.argument("scene", type=PathHere())
@click.option("--engines", metavar="A,B,C", help="Engines, with commas between. [default: all that are ready]")
@click.option(
    "--out",
    "-o",
    metavar="FOLDER",
    type=PathHere(),
    help="Where it all goes. [default: the scene's name with .compare, in the current folder]",
)
@settings_options
@makers_options(
    "Engines at a time; they share the processors then, and times are not those of a run alone. [default: 1]"
)
@keep_at_option
@click.option("--size", type=Size(), default="480x360", show_default=True, help="Of a film, in pixels.")
@most_memory_option
@trust_code_option
@overwrite_option("a comparison")
@click.option("--json", "as_json", is_flag=True, help="Print what was found as JSON, and no progress.")
def compare(
    scene: Path,
    engines: str | None,
    out: Path | None,
    settings: Settings,
    makers: Makers,
    keep_at: str | None,
    size: tuple[int, int],
    overwrite: bool,
    trust_code: bool,
    as_json: bool,
) -> None:
    """Run a scene with several engines and show how far apart they are.

    SCENE is a TOML file, as for "gasp run". Each engine runs in a process of its own. Distances are between the
    vertices of all Gaussians that move, in percent of the diagonal of the largest object.
    """
    from gasp_core import compare as carry_out
    from gasp_core.errors import AccuracyError

    folder = Path(scene.stem + ".compare") if out is None else out
    jobs = makers.jobs or 1
    backend, limits = makers.chosen(jobs), makers.limits(jobs)
    loaded = settings.load(scene)
    trusted = code_is_trusted(loaded, trust_code)
    try:
        found = carry_out(
            loaded,
            None if engines is None else [name.strip() for name in engines.split(",") if name.strip()],
            folder,
            name=scene.stem,
            device=settings.device,
            precision=settings.precision,
            at_once=jobs,
            limits=limits,
            backend=backend,
            keep_at=keep_at or "",
            size=size,
            overwrite=overwrite,
            trust_code=trusted,
            progress=False if as_json else None,
        )
    except KeyboardInterrupt:
        kept = f"stopped; the frames so far are kept in {folder}" if any(folder.glob("*.gasp")) else "stopped"
        raise KeyboardInterrupt(kept) from None
    if as_json:
        print_json({"folder": str(found.folder), **found.to_json()})
    else:
        _print_for_people(found)
    if not found.completed:
        reasons = "; ".join(f"{row.engine}: {row.outcome.reason}" for row in found.rows)
        raise AccuracyError(f"no engine came to the end of {scene}, {found.page} shows what there is: {reasons}")


def _print_for_people(found: Comparison) -> None:
    print_table(
        ["ENGINE", "STATUS", "FRAMES", "START s", "RUN s", "SUBSTEPS", "MEMORY MB"], [_cells(row) for row in found.rows]
    )
    for row in found.rows:
        if row.outcome.reason:
            click.echo(f"\n{row.engine}: {row.outcome.reason}")
    if found.pairs:
        click.echo()
        header = ["PAIR", "FRAMES", "RMS %", "P95 %", "SHAPE %", "CENTRE %", "PSNR dB", "SSIM", "PART"]
        print_table(header, [_pair_cells(pair) for pair in found.pairs])
    for note in found.notes:
        click.echo(f"\n{note}")
    click.echo(f"\nto look at: {found.page}")


def _cells(row: Row) -> list[str]:
    outcome = row.outcome
    ran = outcome.frame_count > 1
    return [
        row.engine,
        outcome.ending.value,
        str(outcome.frame_count),
        f"{outcome.start_seconds:.1f}",
        f"{outcome.run_seconds:.2f}" if ran else "-",
        str(outcome.substeps) if ran else "-",
        f"{outcome.peak_bytes / 1e6:.0f}" if outcome.peak_bytes else "-",
    ]


def _pair_cells(pair: Pair) -> list[str]:
    name = f"{pair.first} - {pair.second}"
    if pair.distance is None:
        return [name, "-", pair.reason]
    far, like = pair.distance, pair.likeness
    shares = [far.rms_share, far.p95_share, far.shape_share, far.centre_share]
    pictures = ["-", "-"] if like is None else [f"{like.psnr:.1f}", f"{like.ssim:.3f}"]
    return [name, str(len(far.frames)), *(f"{100 * share:.3g}" for share in shares), *pictures, str(pair.parting)]

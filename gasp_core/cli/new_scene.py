"""``gasp new``: a scene file for a splat, to be run as it is and changed."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.run_path import PathHere
from gasp_core.io.format_errors import shown

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians
    from gasp_core.scene.objects import UpAxis

__all__ = ["new", "scene_text"]

_AXES = ("-y", "+y", "+z", "-z", "+x", "-x")
_HEIGHT = 0.4
_HARD = 1e9
"""Young's modulus [Pa] from which on a material is taken for rigid: of wood, stone and metals."""
_MATERIAL = "soft rubber"
_LONGEST_NAME = 100
_DROP = 0.5
"""Of its height, from which it falls."""


@click.command(
    epilog="""\b
Examples:
  gasp new plant.splat                                 plant.toml: asks, or guesses where nobody sits at it
  gasp new statue.ply --height 1.7 --material stone -o statue.toml
  gasp run plant.toml --preview                        what comes next
"""
)
@click.argument("splat", type=PathHere())
@click.option("--out", "-o", metavar="SCENE", type=PathHere(), help="[default: SPLAT's name, .toml]")
@click.option("--height", metavar="METRES", type=click.FloatRange(min=0, min_open=True), help="How tall it is.")
@click.option("--material", metavar="PRESET", help='What it is made of; "gasp materials" lists them.')
@click.option(
    "--up", type=click.Choice(_AXES), help="The file's axis that points up. [default: its widest end is down]"
)
@click.option("--yes", "-y", is_flag=True, help="Ask nothing.")
@overwrite_option("a scene file")
@most_memory_option
def new(
    splat: Path,
    out: Path | None,
    height: float | None,
    material: str | None,
    up: UpAxis | None,
    yes: bool,
    overwrite: bool,
) -> None:
    """Write a scene for a splat: it falls on a floor.

    SPLAT is looked at: which end is up, what floats around it. Its height and material no file knows: they are asked
    for, or guessed and said to be guesses. The scene file has a comment for every line.
    """
    from gasp_core.io.atomic import replacing
    from gasp_core.io.detect import read
    from gasp_core.scene.loading import read_scene
    from gasp_core.scene.presets import find_preset
    from gasp_core.scene.standing import guess_up, standing_part

    path = out if out is not None else Path(f"{_stem(splat)}.toml")
    if path.suffix.lower() != ".toml":
        raise click.UsageError(f"--out {path} does not end in .toml, as scenes do")
    keep_what_is_there([path], overwrite, read=[splat])
    gaussians, _ = read(splat)
    asked = not yes and sys.stdin.isatty() and sys.stderr.isatty()
    guessed_up, sure = guess_up(standing_part(gaussians))
    axis = up or guessed_up
    if asked and up is None:
        axis = click.prompt("Which axis of the file points up?", default=guessed_up, type=click.Choice(_AXES), err=True)
    if asked and height is None:
        height = click.prompt("How tall is it, in metres?", default=_HEIGHT, type=float, err=True)
    if asked and material is None:
        material = click.prompt("What is it made of? (gasp materials)", default=_MATERIAL, err=True)
    preset = find_preset(material or _MATERIAL)
    text = scene_text(
        splat, path, height=height, material=None if material is None else preset.name, up=axis, sure=sure or bool(up)
    )
    # What is wrong with a height or a path is told before anything is written.
    read_scene(text, file=str(path), folder=path.parent)
    with replacing(path) as stream:
        stream.write(text.encode())
    # What was asked for was answered, if only by taking what was offered.
    tall, made = ("" if said is not None else " (a guess)" for said in (height, material))
    click.echo(
        f"{path}: {len(gaussians):,} Gaussians, {axis} up{'' if sure or up or asked else ' (a guess)'},"
        f" {height or _HEIGHT:g} m tall{tall}, {preset.name}{made}"
    )
    for note in _noted(gaussians, splat):
        click.echo(note)
    click.echo(f"a first look: gasp run {shlex.quote(str(path))} --preview")


def scene_text(splat: Path, scene: Path, *, height: float | None, material: str | None, up: str, sure: bool) -> str:
    """A scene in which a splat falls on a floor, with comments.

    Parameters
    ----------
    splat
        The file, as the user named it.
    scene
        Where the scene is to be: the splat is named from there.
    height, material
        None: guessed, and said so.
    up, sure
        The file's axis that is up, and whether there is anything to say so.
    """
    from gasp_core.scene.presets import find_preset
    from gasp_core.scene.writing import path_from, toml_text

    tall = _HEIGHT if height is None else height
    stem, quoted = _stem(splat), shlex.quote(str(scene))
    preview, filming = f"gasp run {quoted} --preview", f"gasp run {quoted} --render {shlex.quote(f'{scene.stem}.mp4')}"
    broad = max(len(preview), len(filming))
    upright = "it stands on its widest end so" if sure else "as 3DGS writes files; it lies on its side? try another"
    guess = (
        "a guess: no file knows; say it"
        if height is None
        else "from its lowest Gaussian to its highest, but for the outermost thousandth"
    )
    made = "a guess; gasp materials lists what there is" if material is None else "gasp materials says its numbers"
    substance = f'"{material or _MATERIAL}"'
    if getattr(find_preset(material or _MATERIAL).material, "youngs_modulus", 0.0) >= _HARD:
        # In reality it gives way by what nobody sees; elastic it would spring back whole, after very many steps.
        substance, made = f'{{ preset = {substance}, model = "rigid" }}', f"{made}; rigid, as it gives way invisibly"
    rows = {
        "name": (toml_text(shown(stem)[:_LONGEST_NAME]), ""),
        "splat": (toml_text(path_from(splat, scene.parent)), ""),
        "up": (f'"{up}"', f"the file's axis that points up: {upright}"),
        "height": (f"{tall:g}", f"metres; {guess}"),
        "position": (f"[0, 0, {_DROP * tall:g}]", "metres: the middle of its foot, and how high its lowest point is"),
        "rotation": ("[0, 0, 0]", "degrees about x, y and z"),
        "velocity": ("[0, 0, 0]", "metres a second"),
        "material": (substance, made),
    }
    wide = max(len(f"{key} = {value}") for key, (value, comment) in rows.items() if comment)
    lines = [f"{key} = {value}".ljust(wide if comment else 0) + (f"  # {comment}" if comment else "")
             for key, (value, comment) in rows.items()]  # fmt: skip
    return f"""\
# {shown(splat.name)} falls on a floor. Lengths are in metres, +z is up; docs/scene.md has every key.
#   {preview:{broad}}    a first look
#   {filming:{broad}}    all of it

[scene]
duration = 2.0    # seconds
frame_rate = 25   # a second
# gravity = [0, 0, -9.81]

[[object]]
{chr(10).join(lines)}
# another material's numbers: material = {{ preset = "{material or _MATERIAL}", density = 500 }}

[[collider]]
shape = "plane"
height = 0.0      # the floor
friction = 0.5

# What holds it, where it is to be held:
# [[drive]]
# kind = "pinned"
# region = {{ shape = "sphere", center = [0, 0, {(1 + _DROP) * tall:g}], radius = {0.1 * tall:g} }}

[accuracy]
resolution = 24   # cells along its longest side: twice as many take some ten times as long
"""


def _stem(splat: Path) -> str:
    """Of plant.compressed.ply, plant."""
    name = splat.resolve().name
    return name.split(".")[0] or name


def _noted(gaussians: Gaussians, splat: Path) -> list[str]:
    from gasp_core.io.inspect import summarise

    summary = summarise(gaussians, path=str(splat), kind="")
    return [f"odd: {oddity}" for oddity in summary.oddities]

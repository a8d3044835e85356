"""``gasp inspect``: what is in a splat file, and which body it stands for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gasp_core.cli.levels import level_option
from gasp_core.cli.most_memory import most_memory_option
from gasp_core.cli.overwriting import keep_what_is_there, overwrite_option
from gasp_core.cli.printing import print_json
from gasp_core.cli.run_path import PathHere
from gasp_core.cli.up_axes import UP_AXES

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians
    from gasp_core.scene.placed_solid import PlacedSolid
    from gasp_core.scene.selection import PlacedObject

__all__ = ["inspect"]

_MOST_SHOWN = 12


@click.command(
    epilog="""\b
Examples:
  gasp inspect plant.splat
  gasp inspect bust.sog --json | jq .count
  gasp inspect robot/lod-meta.json --level 2       # of a streamed SOG; 0, the finest, is what a scene takes
  gasp inspect plant.splat --height 0.4            # where things are in a scene, e.g. for a pin
  gasp inspect plant.splat --min-opacity 0.1       # components as an object with min_opacity = 0.1 has them
  gasp inspect statue.sog --solid --height 0.4     # the body inside, and slices of it

\b
Formats: .ply (also compressed and flat), .splat, .spz, .sog (zip, folder, or streamed), .glb (glTF with
KHR_gaussian_splatting), .usdc, .usda, .usd and .usdz (USD's ParticleField3DGaussianSplat; takes usd-core).
"""
)
@click.argument("file", type=PathHere())
@level_option
@most_memory_option
@click.option("--solid", is_flag=True, help="Find the body that the splat is the surface of, and draw slices of it.")
@click.option(
    "--slices",
    type=PathHere(),
    help="Picture of them; implies --solid. [default: NAME.solid.png]",
)
@click.option("--height", type=float, metavar="METRES", help="As in a scene: coordinates are in metres then.")
@click.option("--up", type=click.Choice(UP_AXES), default="-y", show_default=True, help="The file's axis that is up.")
@click.option(
    "--min-opacity",
    type=click.FloatRange(0, 1),
    default=0.0,
    show_default=True,
    help="As min_opacity of an object: what is fainter is in no component, and not in what --height and --solid tell.",
)
@overwrite_option("a picture of slices")
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def inspect(
    file: Path,
    level: int,
    solid: bool,
    slices: Path | None,
    height: float | None,
    up: Any,
    min_opacity: float,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Describe a splat file and say what is odd about it.

    Prints the number of Gaussians, the degree of the spherical harmonics, the extents, percentiles of scale, opacity
    and flatness, everything that may give trouble, and what parts of an object may be named by: connected components,
    and properties of a .ply that are none of any splat's. Components are numbered as component = N of a scene counts
    them, among the Gaussians that are drawn: those that are finite, have an extent, and are as opaque as --min-opacity
    says. With --height, where the object is in a scene that puts it at position = [0, 0, 0], +z up. With --solid, the
    body that its Gaussians are the surface of: how large, of how many parts, how sure that is, and slices of it in a
    picture.
    """
    from gasp_core.io.detect import read
    from gasp_core.io.inspect import summarise

    if solid:
        slices = slices or Path(f"{file.stem or file.name}.solid.png")
    if slices is not None:
        if slices.suffix.lower() != ".png":
            raise click.UsageError(f"--slices {slices} does not end in .png")
        keep_what_is_there([slices], overwrite, "--slices", read=[file])
    gaussians, kind = read(file, level=level)
    summary = summarise(gaussians, path=str(file), kind=kind)
    told, lines = summary.to_json(), [summary.to_text()]
    told["parts"], text = _for_parts(file, gaussians, kind, min_opacity)
    lines.append(text)
    if height is not None or slices is not None:
        from gasp_core.scene.objects import SplatObject
        from gasp_core.scene.selection import place_object

        item = SplatObject(
            name=file.name,
            splat=gaussians,
            static=True,
            up=up,
            height=height,
            min_opacity=min_opacity,
            position=None if height is None else (0, 0, 0),
        )
        placed = place_object(item, gaussians)
        unit = "m" if height is not None else ""
        if height is not None:
            told["scene"], text = _in_scene(placed)
            lines.append(text)
        if slices is not None:
            body = placed.solid()
            told["solid"], text = _of_solid(body, unit)
            lines.append(f"{text}\n    slices       {slices}")
            from gasp_core.rendering.solid_slices import draw_slices

            draw_slices(slices, body, placed.gaussians.means[~placed.floating], unit)
    if as_json:
        print_json(told)
    else:
        click.echo("\n\n".join(lines))


def _for_parts(file: Path, gaussians: Gaussians, kind: str, min_opacity: float) -> tuple[dict[str, Any], str]:
    """What parts of an object may be named by: its components, and labels in the file itself."""
    import numpy as np

    from gasp_core.io.columns import own_columns
    from gasp_core.scene.floaters import LARGE, components
    from gasp_core.scene.selection import drawn_rows

    drawn = drawn_rows(gaussians, min_opacity)
    sizes = np.bincount(components(gaussians.means[drawn]))[1:].tolist()
    large = [size for size in sizes[:_MOST_SHOWN] if size >= LARGE * sum(sizes)]
    shown = ", ".join(f"{number}: {size:,}" for number, size in enumerate(large, start=1))
    smaller = f", and {len(sizes) - len(large):,} smaller" if len(sizes) > len(large) else ""
    left_out = len(gaussians) - len(drawn)
    among = f"; {left_out:,} Gaussians are not drawn and in none" if left_out else ""
    lines = [f"    components   {shown or 'none'}{smaller}{among}"]
    properties: dict[str, Any] = {}
    for name, values in own_columns(file).items() if kind.endswith("ply") else ():
        different, counts = np.unique(values, return_counts=True)
        if len(different) <= _MOST_SHOWN:
            properties[name] = dict(zip(map(str, different.tolist()), counts.tolist()))
            shown = ", ".join(f"{label:g}: {count:,}" for label, count in zip(different, counts))
        else:
            properties[name] = {"different": len(different)}
            shown = f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}, {len(different):,} different"
        lines.append(f"    {name:<12} {shown}")
    told = {"components": sizes, "drawn": len(drawn), "properties": properties}
    return told, "\n".join(["  for parts, Gaussians of each", *lines])


def _in_scene(placed: PlacedObject) -> tuple[dict[str, Any], str]:
    """Box of what does not float, in metres."""
    means = placed.gaussians.means[~placed.floating]
    lower, upper = means.min(axis=0), means.max(axis=0)
    rows = "\n".join(
        f"    {name:<8}" + "".join(f"{value:>12.4g}" for value in row)
        for name, row in (("lowest", lower), ("highest", upper))
    )
    text = (
        "  in a scene, at position 0 0 0 [m], +z up\n"
        + f"    {'':<8}"
        + "".join(f"{axis:>12}" for axis in "xyz")
        + f"\n{rows}"
    )
    return {"lowest": lower.tolist(), "highest": upper.tolist(), "scale": placed.placement.scale}, text


def _of_solid(body: PlacedSolid, unit: str) -> tuple[dict[str, Any], str]:
    """The solid's figures, for programs and for people."""
    solid, doubts = body.solid, body.solid.doubts
    volume, uncertainty = body.volume, doubts.volume_uncertainty * body.scale**3
    area, thickness = float(solid.sheets.areas.sum()) * body.scale**2, solid.sheets.thickness * body.scale
    properties = body.mass_properties()
    parts = solid.parts()[1]
    left_out = {name: getattr(doubts, name) for name in ("faint", "hazy", "far", "floating")}
    told = {
        "volume": volume,
        "volume_uncertainty": uncertainty,
        "undecided": doubts.undecided,
        "parts": parts,
        "sheets": {"area": area, "thickness": thickness},
        "centre": properties.centre.tolist(),
        "inertia": properties.inertia.tolist(),
        "detail": body.detail,
        "underside_closed": doubts.underside_closed,
        "left_out": left_out,
    }

    def measured(value: float, power: int) -> str:
        return f"{value:.4g} {unit}{'' if power == 1 else f'^{power}'}" if unit else f"{value:.4g}"

    inside = "nothing: the Gaussians enclose no volume"
    if volume > 0:
        inside = (
            f"{measured(volume, 3)} in {parts} part{'s' if parts > 1 else ''},"
            f" give or take {100 * uncertainty / volume:.0f} %, as solids of larger details tell"
        )
    rows = {
        "inside": inside,
        "thin": f"{measured(area, 2)} of sheets, taken to be {measured(thickness, 1)} thick" if area else "nothing",
        "centre": " ".join(f"{value:.4g}" for value in properties.centre),
        "detail": f"{measured(body.detail, 1)}: smaller things are not told apart",
        "underside": "open in the splat, closed at the lowest layer" if doubts.underside_closed else "as in the splat",
        "undecided": f"{100 * doubts.undecided:.1f} % of the inside is neither dark nor beside a surface",
        "left out": ", ".join(f"{count:,} {name}" for name, count in left_out.items() if count) or "nothing",
    }
    return told, "\n".join(["  solid", *(f"    {name:<12} {text}" for name, text in rows.items())])

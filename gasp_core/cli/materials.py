"""``gasp materials``: what a scene may say by name, with its numbers, where these are from, and who models it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gasp_core.cli.printing import print_json, print_table

if TYPE_CHECKING:
    from gasp_core.scene.preset_table import MaterialPreset

__all__ = ["materials"]


@click.command(
    epilog="""\b
Examples:
  gasp materials
  gasp materials steel "wet sand"      numbers, what they are in reality, sources
  gasp materials --json | jq '.materials[] | select(.model == "fluid") | .name'

\b
In a scene file:
  material = "rubber"
  material = { preset = "rubber", youngs_modulus = 5e6 }
  material = { preset = "steel", model = "rigid" }      it does not deform
"""
)
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="Print everything that is known of each, as JSON.")
def materials(names: tuple[str, ...], as_json: bool) -> None:
    """List the materials that have a name: numbers, sources, engines.

    With a NAME: each of its numbers, the range it has in reality, why it is another one where it is, and the source.
    """
    from gasp_core.scene.preset_table import PRESETS
    from gasp_core.scene.presets import find_preset

    presets = [find_preset(name) for name in names] or list(PRESETS)
    if as_json:
        print_json({"materials": [_plain(preset) for preset in presets]})
    elif names:
        click.echo("\n\n".join(_described(preset) for preset in presets))
    else:
        _print_list(presets)


def _engines(preset: MaterialPreset) -> list[str]:
    """The installed engines that model it, by name."""
    from gasp_core.discovery.registry import discover

    kind = type(preset.material)
    return [name for name, engine in discover().engines.items() if kind in engine.capabilities.materials]


def _plain(preset: MaterialPreset) -> dict[str, object]:
    return {
        "name": preset.name,
        "aliases": list(preset.aliases),
        "model": preset.material.kind,
        "summary": preset.summary,
        "numbers": preset.numbers,
        "ranges": {name: list(ends) for name, ends in preset.ranges.items()},
        "stand_ins": dict(preset.stand_ins),
        "source": preset.source,
        "engines": _engines(preset),
    }


def _print_list(presets: list[MaterialPreset]) -> None:
    rows: list[list[str]] = []
    for preset in presets:
        numbers = preset.numbers
        stiffness = "youngs_modulus" if "youngs_modulus" in numbers else "bulk_modulus"
        rows.append(
            [
                preset.name,
                preset.material.kind,
                f"{numbers['density']:g}",
                _number(numbers[stiffness]),
                f"{numbers['poissons_ratio']:g}" if "poissons_ratio" in numbers else "-",
                " ".join(_engines(preset)) or "-",
            ]
        )
    print_table(["PRESET", "MODEL", "KG/M^3", "STIFFNESS PA", "POISSON", "ENGINES"], rows)
    click.echo("\ngasp materials NAME says what each number is in reality, and where it is from.")


def _described(preset: MaterialPreset) -> str:
    """A preset in a few lines."""
    called = f" (also: {', '.join(preset.aliases)})" if preset.aliases else ""
    lines = [
        f"{preset.name}{called}: {preset.summary}",
        f"  model    {preset.material.kind}",
        f"  engines  {' '.join(_engines(preset)) or 'none that is installed'}",
        f"  source   {preset.source}",
    ]
    numbers = preset.numbers
    wide = max(map(len, numbers))
    for name, value in numbers.items():
        why = f": {preset.stand_ins[name]}" if name in preset.stand_ins else ""
        lines.append(f"  {name:{wide}}  {_number(value)}, in reality {_range(preset, name)}{why}")
    return "\n".join(lines)


def _range(preset: MaterialPreset, name: str) -> str:
    low, high = preset.ranges[name]
    return _number(low) if low == high else f"{_number(low)} to {_number(high)}"


def _number(value: float) -> str:
    """2.1e11, as one writes it."""
    mantissa, _, exponent = f"{value:.5g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa

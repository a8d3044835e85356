"""From one splat format to another, and what is lost on the way."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat, write_splat

__all__ = ["convert", "losses"]

Array = NDArray[Any]


def convert(
    source: str | PathLike[str], target: str | PathLike[str], *, flat_axis: int = 2, level: int = 0
) -> tuple[str, ...]:
    """Read one splat file and write it as another.

    Parameters
    ----------
    source, target
        As `read_splat` and `write_splat` take them.
    flat_axis, level
        As `read_splat` takes them.

    Returns
    -------
    tuple of str
        What the target cannot hold, a sentence each; empty where nothing of note is lost.

    Raises
    ------
    SplatFormatError
        As reading and writing do.
    """
    gaussians = read_splat(source, flat_axis=flat_axis, level=level)
    write_splat(target, gaussians)
    return losses(gaussians, Path(fspath(target)).suffix.lower())


def losses(gaussians: Gaussians, suffix: str) -> tuple[str, ...]:
    """What writing these Gaussians in a format loses.

    Parameters
    ----------
    gaussians
        Finite.
    suffix
        One that `write_splat` writes.

    Returns
    -------
    tuple of str
        A sentence for each loss; empty for a .ply of what came in float32.
    """
    if suffix not in (".splat", ".spz", ".sog", ".glb"):
        return ("positions are rounded to float32",) if gaussians.means.dtype == np.float64 else ()
    told = {".splat": _splat_losses, ".spz": _spz_losses, ".sog": _sog_losses, ".glb": _glb_losses}
    return told[suffix](gaussians)


def _splat_losses(gaussians: Gaussians) -> tuple[str, ...]:
    from gasp_core.io.activations import dc_to_colour

    lost = ["opacities and colours are rounded to 1/255, rotations to 1/128"]
    if gaussians.sh_degree:
        lost.append(
            f"harmonics of degree 1 to {gaussians.sh_degree} are dropped, so colours no longer depend on the view"
        )
    colours = dc_to_colour(gaussians.harmonics[:, 0])
    # Half a step is what rounding alone may change.
    lost += _clipped("colours", (colours < -0.5 / 255) | (colours > 1 + 0.5 / 255), "0..1")
    return tuple(lost)


def _spz_losses(gaussians: Gaussians) -> tuple[str, ...]:
    from gasp_core.io.spz import position_bits

    step = 0.5 ** position_bits(gaussians.means)
    lost = [f"positions are rounded to {step:.2g}, scales to 6 %, opacities to 1/255, rotations to 1/722"]
    if gaussians.sh_degree > 3:
        lost.append("harmonics of degree 4 are dropped")
    smallest, largest = np.exp(-10.0), np.exp(255 / 16 - 10)
    scales, harmonics = gaussians.scales.astype(np.float64), gaussians.harmonics
    # Half a step beyond an end still rounds to it.
    half_scale = np.exp(1 / 32)
    outside = (scales < smallest / half_scale) | (scales > largest * half_scale)
    lost += _clipped("scales", outside, f"{smallest:.2g}..{largest:.3g}")
    dc, directional = harmonics[:, 0], harmonics[:, 1:16]
    lost += _clipped("colours", np.abs(dc) > (0.5 + 0.5 / 255) / 0.15, "-3.33..3.33")
    lost += _clipped("harmonics", (directional < -1 - 0.5 / 128) | (directional > 127.5 / 128), "-1..1")
    return tuple(lost)


def _sog_losses(gaussians: Gaussians) -> tuple[str, ...]:
    from gasp_core.io.sog_writing import position_step

    step = position_step(gaussians.means)
    lost = [
        f"positions are rounded to {step:.2g}, scales and colours to 256 values each, opacities to 1/255, rotations "
        "to 1/180"
    ]
    if gaussians.sh_degree:
        lost.append("harmonics of degree >= 1 are rounded to 256 values, those of all Gaussians to 65,536 sets of them")
    if gaussians.sh_degree > 3:
        lost.append("harmonics of degree 4 are dropped")
    return tuple(lost)


def _glb_losses(gaussians: Gaussians) -> tuple[str, ...]:
    lost = ["positions are rounded to float32"] if gaussians.means.dtype == np.float64 else []
    if gaussians.sh_degree > 3:
        lost.append("harmonics of degree 4 are dropped")
    return tuple(lost)


def _clipped(what: str, outside: Array, limits: str) -> list[str]:
    """A sentence on the Gaussians with a value outside, if there are any."""
    touched = int(outside.reshape(len(outside), -1).any(axis=1).sum()) if outside.size else 0
    return [f"{what} of {touched:,} Gaussians are cut to {limits}"] if touched else []

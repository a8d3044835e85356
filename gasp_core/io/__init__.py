"""Splat files: the only place that opens them.

Formats are imported when a file asks for them, so that importing this package costs no more than NumPy.
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

from gasp_core.io.memory_limit import memory_limit

if TYPE_CHECKING:
    from gasp_core.gaussians import Gaussians

__all__ = ["memory_limit", "read_splat", "write_splat"]


def read_splat(path: str | PathLike[str], *, flat_axis: int = 2, level: int = 0) -> Gaussians:
    """Read a splat file, whatever its format.

    INRIA ``.ply`` (binary or text, spherical harmonics of degree 0-4, properties in any order and of any numeric
    type), compressed ``.ply`` of PlayCanvas (old and new chunks), ``.splat``, ``.spz`` (versions 1-4) and SOG
    (versions 1 and 2; a ``.sog``, its folder or its ``meta.json``; a streamed one, its folder or its
    ``lod-meta.json``), ``.glb`` (glTF with KHR_gaussian_splatting) and ``.usdc``, ``.usda``, ``.usd`` or ``.usdz``
    (USD's ParticleField3DGaussianSplat; takes usd-core). Content decides before the suffix does.

    The result is in the ordinary 3DGS frame of the file (a ``.spz`` or ``.glb``, stored right-up-back, reads as the
    ``.ply`` it came from; a stage of USD, in metres, from the axis that it says is up); up axis and units are the
    scene's business. Rows are kept as they are, non-finite ones too, and quaternions are not normalised.

    Parameters
    ----------
    path
        File, or folder with a ``meta.json`` or ``lod-meta.json``.
    flat_axis
        Which of a Gaussian's axes has no thickness in a ``.ply`` of only two scales: 2 as 2DGS has it (its normal is
        the rotation's third column; default), 0 as GaMeS and D-MiSo have it. Other files do not use it.

    level
        Of a streamed SOG, 0 the finest; its chunks are put together, its environment is left out. Other files have
        level 0 alone.

    Returns
    -------
    Gaussians
        float32; means are float64 where a ``.ply`` stores them as double, and where nodes of a ``.glb`` or transforms
        of USD move them.

    Raises
    ------
    SplatFormatError
        Where the file is missing, of no known format, malformed, truncated, unpacks to more than it declares, or would
        take more memory than its size can honestly mean, or than there is; `memory_limit` allows it.
    """
    from gasp_core.io.detect import read

    return read(path, flat_axis=flat_axis, level=level)[0]


def write_splat(path: str | PathLike[str], gaussians: Gaussians) -> None:
    """Write a splat file; the suffix says which format: ``.ply`` (INRIA, float32), ``.splat``, ``.spz``,
    ``.sog`` (version 2), ``.glb`` (glTF with KHR_gaussian_splatting) and ``.usdc``, ``.usda`` or ``.usd`` (USD's
    ParticleField3DGaussianSplat; takes usd-core).

    The file appears whole or not at all. What a format cannot hold is dropped as
    :func:`gasp_core.io.convert.losses` tells.

    Parameters
    ----------
    path
        Where to; an existing file is replaced.
    gaussians
        In the ordinary 3DGS frame.

    Raises
    ------
    SplatFormatError
        Where the suffix is none of these, the Gaussians cannot be stored so, or the disk refuses.
    """
    from gasp_core.io.detect import write

    write(path, gaussians)

"""Writing SOG, version 2: what `gasp_core.io.sog` reads, and PlayCanvas, SuperSplat and Spark show.

Every Gaussian keeps its row: spatial order would pack a little better, and rows would not be those of the source.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.activations import logarithm
from gasp_core.io.rotations import unit_quaternions
from gasp_core.io.sog import BASES_OF_DEGREE, LARGEST_PALETTE, PALETTE_WIDTH

__all__ = ["codebook", "palette", "position_step", "sog_members", "write_members", "write_sog"]

Array = NDArray[Any]

_ENTRIES = 256
_STEPS = 65535
"""Of a coordinate, from the lowest to the highest."""
_BLOCKS = 1024
_ROUNDS = 32
"""Of Lloyd's iteration: the squared error then falls by less than 1 % a round."""
_EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Of a zip."""


def write_sog(stream: BinaryIO, gaussians: Gaussians) -> None:
    """Write finite Gaussians as a .sog of version 2; harmonics of degree 4 are dropped."""
    write_members(stream, sog_members(gaussians))


def write_members(stream: BinaryIO, members: Mapping[str, bytes], packed: Mapping[str, bytes] | None = None) -> None:
    """Write a zip of files as they are, and of others that are deflated; the same files always give the same bytes."""
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, _EARLIEST), content)
        for name, content in (packed or {}).items():
            archive.writestr(zipfile.ZipInfo(name, _EARLIEST), content, zipfile.ZIP_DEFLATED, 9)


def sog_members(gaussians: Gaussians) -> dict[str, bytes]:
    """The files of a .sog, by their names."""
    images: dict[str, bytes] = {}
    meta: dict[str, Any] = {"version": 2, "count": len(gaussians)}

    folded = _fold(gaussians.means)
    low, high = folded.min(axis=0), folded.max(axis=0)
    steps = np.round((folded - low) / np.where(high > low, high - low, 1.0) * _STEPS).astype(np.uint16)
    images["means_l.webp"], images["means_u.webp"] = _texture(steps & 255), _texture(steps >> 8)
    meta["means"] = {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]}

    book, entries = codebook(logarithm(gaussians.scales))
    images["scales.webp"] = _texture(entries)
    meta["scales"] = {"codebook": book.tolist(), "files": ["scales.webp"]}

    images["quats.webp"] = _texture(_rotations(gaussians.quaternions))
    meta["quats"] = {"files": ["quats.webp"]}

    book, entries = codebook(gaussians.harmonics[:, 0])
    opacities = np.round(np.clip(gaussians.opacities, 0, 1) * 255).astype(np.uint8)
    images["sh0.webp"] = _texture(np.concatenate([entries, opacities[:, None]], axis=1))
    meta["sh0"] = {"codebook": book.tolist(), "files": ["sh0.webp"]}

    degree = min(gaussians.sh_degree, max(BASES_OF_DEGREE))
    if degree:
        rows, labels = palette(gaussians.harmonics[:, 1 : 1 + BASES_OF_DEGREE[degree]], LARGEST_PALETTE)
        book, entries = codebook(rows)
        images["shN_centroids.webp"] = _palette_image(entries)
        images["shN_labels.webp"] = _texture(np.stack([labels & 255, labels >> 8], axis=1))
        meta["shN"] = {
            "count": len(rows),
            "bands": degree,
            "codebook": book.tolist(),
            "files": ["shN_centroids.webp", "shN_labels.webp"],
        }
    return {"meta.json": json.dumps(meta).encode(), **images}


def _fold(means: Array) -> Array:
    """sign(x) ln(1 + |x|), float64: evenly spaced, it is finer near the origin."""
    return np.sign(means) * np.log1p(np.abs(means.astype(np.float64)))


def position_step(means: Array) -> float:
    """The largest distance between two neighbouring values of a coordinate where there are means (N, 3)."""
    folded = _fold(means)
    return float(((folded.max(axis=0) - folded.min(axis=0)) / _STEPS * (1 + np.abs(means).max(axis=0))).max())


def codebook(values: Array) -> tuple[Array, NDArray[np.uint8]]:
    """256 values, ascending, that stand for many with a small squared error, and which of them each is nearest to.

    Lloyd's iteration in one dimension (1982, 10.1109/TIT.1982.1056489). It begins where entries are as dense as the
    cube root of the values are, which is best for many entries (Panter and Dite 1951, 10.1109/JRPROC.1951.230419); a
    few distinct values stand for themselves.

    Parameters
    ----------
    values : (...)
        Finite.

    Returns
    -------
    book : (256,) float64
        Filled up with its last where there are fewer distinct values.
    entries : (...) uint8
    """
    known, counts = np.unique(values.astype(np.float64), return_counts=True)
    if len(known) <= _ENTRIES:
        book = known
    else:
        sums, weights = (np.append(0.0, np.cumsum(column)) for column in (known * counts, counts))
        book = _spread(values)
        for _ in range(_ROUNDS):
            ends = np.concatenate([[0], np.searchsorted(known, (book[1:] + book[:-1]) / 2), [len(known)]])
            weight = np.diff(weights[ends])
            book = np.where(weight > 0, np.diff(sums[ends]) / np.where(weight > 0, weight, 1.0), book)
    entries = np.searchsorted((book[1:] + book[:-1]) / 2, values.astype(np.float64)).astype(np.uint8)
    return np.pad(book, (0, _ENTRIES - len(book)), mode="edge"), entries


def _spread(values: Array) -> Array:
    """256 values from the lowest to the highest, as dense as the cube root of the density."""
    edges = np.quantile(values, np.linspace(0, 1, _BLOCKS + 1))
    # All blocks hold as many, so the density is 1 / width: its cube root, times the width.
    share = np.append(0.0, np.cumsum(np.diff(edges) ** (2 / 3)))
    return np.interp(np.linspace(0, share[-1], _ENTRIES), share, edges)


def palette(rows: Array, most: int) -> tuple[Array, NDArray[np.uint16]]:
    """At most `most` rows that stand for all, and which of them stands for each.

    Each set of rows is halved at the median along the axis in which it spreads most (median cut: Heckbert 1982,
    10.1145/800064.801294), all sets at once, until there are enough; means stand for the sets.

    Parameters
    ----------
    rows : (N, ...)
    most
        A power of two.
    """
    known, own = np.unique(rows.reshape(len(rows), -1), axis=0, return_inverse=True)
    if len(known) > most:
        known, cut = _median_cut(known.astype(np.float64), most)
        own = cut[own]
    return known.reshape(-1, *rows.shape[1:]), own.astype(np.uint16)


def _median_cut(flat: Array, most: int) -> tuple[Array, Array]:
    """Means (most, D) of as many sets of rows (N, D), and the set each is in."""
    order = np.arange(len(flat))
    starts = np.array([0, len(flat)])
    while len(starts) - 1 < most:
        sizes = np.diff(starts)
        inside = flat[order]
        means = np.add.reduceat(inside, starts[:-1], axis=0) / sizes[:, None]
        spread = np.add.reduceat(inside**2, starts[:-1], axis=0) / sizes[:, None] - means**2
        owner = np.repeat(np.arange(len(sizes)), sizes)
        along = inside[np.arange(len(order)), spread.argmax(axis=1)[owner]]
        order = order[np.lexsort((along, owner))]
        starts = np.append(np.stack([starts[:-1], starts[:-1] + sizes // 2], axis=1).reshape(-1), len(flat))
    sizes = np.diff(starts)
    labels = np.empty(len(flat), dtype=np.intp)
    labels[order] = np.repeat(np.arange(most), sizes)
    return np.add.reduceat(flat[order], starts[:-1], axis=0) / sizes[:, None], labels


def _rotations(quaternions: Array) -> NDArray[np.uint8]:
    """The three smaller components in a byte each, and which is missing, (N, 4)."""
    unit = unit_quaternions(quaternions)
    largest = np.abs(unit).argmax(axis=1)
    rows = np.arange(len(unit))
    unit = unit * np.where(unit[rows, largest] < 0, -1.0, 1.0)[:, None]
    smaller = unit[np.arange(4)[None, :] != largest[:, None]].reshape(-1, 3)
    steps = np.round(np.clip(smaller * math.sqrt(2) / 2 + 0.5, 0, 1) * 255)
    return np.concatenate([steps, 252 + largest[:, None]], axis=1).astype(np.uint8)


def _texture(values: Array) -> bytes:
    """Rows (N, 2 to 4) as pixels, from the left and the top, in an image about as wide as it is high."""
    width = 4 * math.ceil(math.sqrt(len(values)) / 4)
    height = math.ceil(len(values) / width)
    # Unused channels are opaque: PlayCanvas' own have them so, and a decoder may multiply colours by what is not.
    pixels = np.full((height * width, 4), 255, dtype=np.uint8)
    pixels[:, :3] = 0
    pixels[: len(values), : values.shape[1]] = values
    return _webp(pixels.reshape(height, width, 4))


def _palette_image(entries: Array) -> bytes:
    """Rows of a palette (C, K, 3), 64 side by side."""
    count, bases, _ = entries.shape
    height = math.ceil(count / PALETTE_WIDTH)
    pixels = np.zeros((height * PALETTE_WIDTH, bases, 4), dtype=np.uint8)
    pixels[..., 3] = 255
    pixels[:count, :, :3] = entries
    return _webp(pixels.reshape(height, PALETTE_WIDTH * bases, 4))


def _webp(pixels: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    # exact: the colours of what is transparent are numbers too. More effort takes ten times as long for no byte less.
    Image.fromarray(pixels, "RGBA").save(stream, "WEBP", lossless=True, exact=True, quality=50, method=2)
    return stream.getvalue()

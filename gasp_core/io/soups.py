"""Triangle soups: the simplices of a splat as a mesh that any program may move, and the splat that it has become.

A soup is a PLY of triangles: all vertices of all simplices, each Gaussian's own beside each other, in float32 about a
centre. Edges that float32 would not resolve there are lengthened, which `gasp_core.games.magnify` takes back. Beside
its place every vertex has the number of its Gaussian and its own in the simplex, so that it is known in any order.
What a program has moved is held against the soup as it was written: what did not move comes back to the last bit.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SplatFormatError
from gasp_core.games import choose_vertices, demagnify, from_simplices, magnify, to_simplices
from gasp_core.gaussians import Gaussians
from gasp_core.io.columns import map_npy
from gasp_core.io.format_errors import malformed, quoted
from gasp_core.io.memory_limit import refuse_unread
from gasp_core.io.ply import PlyHeader, parse_header, read_table

__all__ = ["Soup", "make_soup", "read_positions", "read_soup", "splat_of", "write_soup"]

Array = NDArray[Any]

SHORTEST_EDGE = 1e-3
"""Of the extent: float32 resolves an edge so long to 6e-5 of itself."""
_SAID = "comment gasp-soup 1 "
_FACES = {3: ((0, 1, 2),), 4: ((0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2))}
_FRESH = "export the soup again"
_KEPT = "nothing may be merged, split or thrown away; move vertices, and keep them all"


@dataclass(frozen=True, slots=True, kw_only=True)
class Soup:
    """A splat's simplices as they lie in a file.

    Parameters
    ----------
    positions : (N, V, 3)
        float32, about `centre`, turned by `turn`, short edges lengthened.
    centre : (3,)
        In the frame and unit of the splat.
    turn : (3, 3)
        From the frame of the splat to that of the soup.
    shortest_edge
        Length to which shorter edges were lengthened, in the unit of the splat.
    digest
        SHA-256 of the splat.
    """

    positions: Array
    centre: Array
    turn: Array
    shortest_edge: float
    digest: str

    @property
    def vertices(self) -> Literal[3, 4]:
        """Of a simplex."""
        return 4 if self.positions.shape[1] == 4 else 3


def make_soup(
    gaussians: Gaussians,
    *,
    vertices: Literal[3, 4, "auto"] = "auto",
    shortest_edge: float = SHORTEST_EDGE,
    turn: Array | None = None,
) -> Soup:
    """The soup of a splat.

    Parameters
    ----------
    gaussians
        N of them.
    vertices
        Of a simplex; "auto" takes four where they are not flat.
    shortest_edge
        Shorter ones are lengthened to it; a share of the splat's longest side.
    turn : (3, 3)
        A rotation by quarter turns, from the frame of the splat to that of the soup.

    Raises
    ------
    SplatFormatError
        Where Gaussians are not finite.
    """
    turn = np.eye(3) if turn is None else turn
    means = gaussians.means.astype(np.float64)
    if not (np.isfinite(means).all() and np.isfinite(gaussians.scales).all()):
        raise SplatFormatError("a soup needs finite Gaussians: drop the others (gasp inspect counts them)")
    centre = (means.min(axis=0) + means.max(axis=0)) / 2
    floor = shortest_edge * float(np.ptp(means, axis=0).max())
    count = choose_vertices(gaussians) if vertices == "auto" else vertices
    magnified, _ = magnify(to_simplices(gaussians.with_(means=means - centre), count), floor)
    return Soup(
        positions=(magnified @ turn.T).astype(np.float32),
        centre=centre,
        turn=turn,
        shortest_edge=floor,
        digest=_digest(gaussians),
    )


def splat_of(soup: Soup, gaussians: Gaussians, positions: Array) -> Gaussians:
    """What a splat has become, whose soup was moved.

    Parameters
    ----------
    soup
        Of the splat, as it was written.
    gaussians
        The splat.
    positions : (N, V, 3)
        Of the soup's vertices now.

    Returns
    -------
    In the frame and unit of the splat; what did not move is what it was, to the last bit.

    Raises
    ------
    SplatFormatError
        Where the soup is that of another splat.
    """
    if _digest(gaussians) != soup.digest:
        raise SplatFormatError("the soup is that of another splat, or the splat has changed since it was exported")
    displacements = positions.astype(np.float64) - soup.positions
    rows = np.flatnonzero(displacements.any(axis=(1, 2)))
    moved = gaussians.select(rows)
    rest = to_simplices(moved.with_(means=moved.means - soup.centre), soup.vertices)
    _, factors = magnify(rest, soup.shortest_edge)
    simplices = soup.centre + rest + demagnify(displacements[rows] @ soup.turn, factors)
    found = from_simplices(simplices, reference=moved)
    changed: dict[str, Array] = {}
    for field in fields(Gaussians):
        array = np.array(getattr(gaussians, field.name))
        array[rows] = getattr(found, field.name)
        changed[field.name] = array
    return Gaussians(**changed)


def write_soup(stream: BinaryIO, soup: Soup) -> None:
    """Write a soup as a binary PLY."""
    count, vertices = soup.positions.shape[:2]
    told = {
        "shape": [count, vertices],
        "centre": soup.centre.tolist(),
        "turn": soup.turn.tolist(),
        "shortest_edge": soup.shortest_edge,
        "splat": soup.digest,
    }
    faces = np.array(_FACES[vertices], dtype=np.int32)
    lines = ["ply", "format binary_little_endian 1.0", _SAID + json.dumps(told)]
    lines += [f"element vertex {count * vertices}", *(f"property float {axis}" for axis in "xyz")]
    lines += ["property int gaussian", "property uchar corner", f"element face {count * len(faces)}"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    stream.write(("\n".join(lines) + "\n").encode("ascii"))
    rows = np.zeros(count * vertices, [("place", "<f4", 3), ("gaussian", "<i4"), ("corner", "u1")])
    rows["place"] = soup.positions.reshape(-1, 3)
    rows["gaussian"] = np.repeat(np.arange(count), vertices)
    rows["corner"] = np.tile(np.arange(vertices), count)
    stream.write(rows.tobytes())
    triangles = np.zeros(count * len(faces), [("corners", "u1"), ("rows", "<i4", 3)])
    triangles["corners"] = 3
    triangles["rows"] = (vertices * np.arange(count)[:, None, None] + faces).reshape(-1, 3)
    stream.write(triangles.tobytes())


def read_soup(path: Path) -> Soup:
    """A soup as `write_soup` wrote it.

    Raises
    ------
    SplatFormatError
        Where it is none, is damaged, or has been written by another program.
    """
    data, header = _ply(path)
    lines = data[: header.size].decode("latin-1").splitlines()
    said = [line.removeprefix(_SAID) for line in lines if line.startswith(_SAID)]
    if not said:
        raise malformed(
            path,
            "is no soup as gasp wrote it: the line that tells its splat is gone",
            "name the soup that was exported first, what a program has made of it after it",
        )
    try:
        told = json.loads(said[0])
        count, vertices = told["shape"]
        centre, turn = np.array(told["centre"], dtype=np.float64), np.array(told["turn"], dtype=np.float64)
        edge, digest = float(told["shortest_edge"]), str(told["splat"])
        whole = vertices in (3, 4) and type(count) is int and centre.shape == (3,) and turn.shape == (3, 3)
        sound = whole and np.isfinite(centre).all() and np.abs(turn @ turn.T - np.eye(3)).max() < 1e-12 and edge >= 0
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise malformed(path, "the line that tells its splat is damaged", _FRESH) from error
    if not sound:
        raise malformed(path, "the line that tells its splat is damaged", _FRESH)
    positions = _positions_of(data, header, (count, vertices), path)
    return Soup(positions=positions, centre=centre, turn=turn, shortest_edge=edge, digest=digest)


def read_positions(path: Path, soup: Soup) -> Array:
    """What a program has made of a soup.

    Parameters
    ----------
    path
        A .ply: vertices by the numbers that the soup gave them, or, where the program has not kept these, in the
        order of the soup. Or a .npy of NumPy: (N V, 3), or (T, N V, 3) for T frames, in the order of the soup.
    soup
        As it was written.

    Returns
    -------
    (T, N, V, 3) float32

    Raises
    ------
    SplatFormatError
        Where the file is neither, or vertices are missing, too many, or not finite.
    """
    shape = soup.positions.shape
    if path.suffix.lower() == ".npy":
        found = _array(path, shape[0] * shape[1]).reshape(-1, *shape)
    elif path.suffix.lower() == ".ply":
        found = _positions_of(*_ply(path), shape[:2], path)[None]
    else:
        raise malformed(
            path,
            f"{quoted(path.suffix or path.name)} is no file of moved vertices",
            "write .ply or .npy: others round, or lose the order of vertices",
        )
    bad = ~np.isfinite(found).all(axis=(2, 3))
    if bad.any():
        frame, row = np.argwhere(bad)[0]
        where = f" of frame {frame}" if len(found) > 1 else ""
        raise malformed(
            path, f"vertices of {int(bad.sum()):,} Gaussians are not finite, the first is {row:,}{where}", "look there"
        )
    return found


def _digest(gaussians: Gaussians) -> str:
    digest = hashlib.sha256()
    for field in fields(gaussians):
        array = getattr(gaussians, field.name)
        digest.update(f"{field.name} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array, dtype="<f4").tobytes())
    return digest.hexdigest()


def _ply(path: Path) -> tuple[bytes, PlyHeader]:
    try:
        refuse_unread(path, path.stat().st_size)
        data = path.read_bytes()
    except OSError as error:
        raise malformed(
            path, f"cannot be read: {error.strerror or error}", "check the path and its permissions"
        ) from error
    return data, parse_header(data, path)


def _positions_of(data: bytes, header: PlyHeader, shape: tuple[int, ...], path: Path) -> Array:
    """Places (N, V, 3) float32 of a PLY's vertices, in the order of the soup."""
    table = read_table(data, header, "vertex", path)
    names = table.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise malformed(path, "its vertices have no x, y and z", _FRESH)
    count, vertices = shape
    if len(table) != count * vertices:
        raise malformed(path, f"has {len(table):,} vertices, the soup {count * vertices:,}", _KEPT)
    places = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float32)
    if not {"gaussian", "corner"} <= set(names):
        return places.reshape(count, vertices, 3)
    # Programs that know no whole numbers have kept them as others.
    with np.errstate(invalid="ignore"):
        rows = np.rint(table["gaussian"]).astype(np.int64) * vertices + np.rint(table["corner"]).astype(np.int64)
    if not np.array_equal(np.sort(rows), np.arange(count * vertices)):
        raise malformed(path, "the numbers of its vertices are not each there once", _KEPT)
    ordered = np.empty_like(places)
    ordered[rows] = places
    return ordered.reshape(count, vertices, 3)


def _array(path: Path, rows: int) -> Array:
    found = map_npy(path, "write it with numpy.save, places of all vertices in the order of the soup")
    if found.ndim not in (2, 3) or found.shape[-2:] != (rows, 3):
        raise malformed(path, f"is of shape {found.shape}, not ({rows}, 3) or (frames, {rows}, 3)", _KEPT)
    with np.errstate(over="ignore"):
        return found.astype(np.float32, copy=False)

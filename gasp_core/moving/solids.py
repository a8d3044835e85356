"""What is solid beside a moving splat: an entry of its header for each collider, and files where numbers are many.

What a formula describes is its numbers. A signed distance field is a table of whole numbers, sixty-fourths of a
spacing; what is farther off the surface than two spacings is as if it were two. What moves has a pose for every frame.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import (
    BoxShape,
    Collider,
    HalfSpace,
    KeyframedMotion,
    Shape,
    Side,
    SignedDistanceField,
    SphereShape,
)
from gasp_core.errors import SceneError
from gasp_core.io.format_errors import quoted
from gasp_core.moving.integers import decoded, encoded
from gasp_core.scene.file_shapes import resolved
from gasp_core.stepping.rigid_motion import pose_of

__all__ = ["entries_of", "solids_of"]

Array = NDArray[Any]
Entry = dict[str, Any]

_FORMULAS: dict[str, type[Shape]] = {shape.kind: shape for shape in (HalfSpace, SphereShape, BoxShape)}
_FIELD = SignedDistanceField.kind
_STEPS = 64
"""Of a spacing."""
_FARTHEST = 2 * _STEPS
_MOST_NODES = 256
"""Of a field, along an axis: what any graphics card takes."""
_MOST_NODES_IN_ALL = 1 << 25
_MOST = 1000
"""Colliders."""
_MOST_POSES = 1 << 18
"""In all: those of ten colliders for a quarter of an hour."""
_POSE = 7
"""Numbers of a pose: the place and the quaternion."""


def entries_of(colliders: Sequence[Collider], times: Array) -> tuple[list[Entry], dict[str, bytes]]:
    """Entries of the header, and files by their names.

    Parameters
    ----------
    colliders
        What engines know no shape of is left out.
    times : (F,) [s]
        Of the frames.

    Raises
    ------
    ValueError
        Where they are more than readers take.
    SceneError
        Where a file of one cannot be read.
    """
    entries: list[Entry] = []
    files: dict[str, bytes] = {}
    _refuse_too_many(len(colliders), len(times) * sum(one.motion is not None for one in colliders), 0)
    for one in map(resolved, colliders):
        name, shape = f"{len(entries)}/", one.shape
        entry: Entry = {"kind": shape.kind, "side": one.side.value}
        if isinstance(shape, SignedDistanceField):
            field = _coarse(shape)
            entry |= {"origin": list(field.origin), "spacing": field.spacing, "nodes": list(field.values.shape)}
            files[name + "field"] = _table(field)
        elif isinstance(shape, tuple(_FORMULAS.values())):
            entry |= dataclasses.asdict(cast("Any", shape))
        else:
            continue
        if one.motion is not None:
            entry["moves"] = list(one.motion.center)
            files[name + "poses"] = _poses(one, times)
        entries.append(entry)
    _refuse_too_many(0, 0, sum(math.prod(entry["nodes"]) for entry in entries if "nodes" in entry))
    return entries, files


def solids_of(
    entries: Sequence[Mapping[str, Any]], fetch: Callable[[str, int], bytes], times: Array
) -> tuple[Collider, ...]:
    """The colliders of a header; kinds that are not known here are left out.

    Parameters
    ----------
    entries
        As `entries_of` gave them.
    fetch
        Gives a file by its name, no longer than so many bytes.
    times : (F,) [s]
        Of the frames.

    Raises
    ------
    ValueError
        Where they are damaged.
    """
    found: list[Collider] = []
    _refuse_too_many(len(entries), len(times) * sum("moves" in entry for entry in entries), 0)
    nodes = 0
    for number, entry in enumerate(entries):
        kind, name = entry.get("kind"), f"{number}/"
        if kind not in (*_FORMULAS, _FIELD):
            continue
        try:
            if kind == _FIELD:
                nodes += math.prod(_nodes_of(entry))
                _refuse_too_many(0, 0, nodes)
            shape = (
                _field_of(entry, lambda most, name=name: fetch(name + "field", most))
                if kind == _FIELD
                else _FORMULAS[kind](**{key: entry[key] for key in _names(_FORMULAS[kind])})
            )
            motion = None
            if "moves" in entry:
                motion = _motion_of(entry["moves"], fetch(name + "poses", 8 * _POSE * len(times)), times)
            found.append(Collider(shape=shape, side=Side(entry["side"]), motion=motion))
        except (KeyError, TypeError, ValueError, OverflowError, SceneError) as error:
            told = f"lacks {error}" if isinstance(error, KeyError) else quoted(error)
            raise ValueError(f"collider {number + 1} is damaged: {told}") from error
    return tuple(found)


def _refuse_too_many(colliders: int, poses: int, nodes: int) -> None:
    """A file of a few kB could take all memory there is."""
    for count, most, what in (
        (colliders, _MOST, "colliders"),
        (poses, _MOST_POSES, "poses of colliders that move"),
        (nodes, _MOST_NODES_IN_ALL, "nodes of signed distance fields"),
    ):
        if count > most:
            raise ValueError(f"{count:,} {what}, {most:,} are the most that a moving splat may have")


def _names(shape: type[Shape]) -> list[str]:
    return [field.name for field in dataclasses.fields(cast("Any", shape))]


def _coarse(field: SignedDistanceField) -> SignedDistanceField:
    """The same with no more nodes along an axis than a picture needs."""
    from scipy import ndimage

    share = math.ceil((max(field.values.shape) - 1) / (_MOST_NODES - 2))
    if share == 1:
        return field
    # Whole steps along every axis, so that the outermost nodes are outside still.
    margins = [(0, -(count - 1) % share) for count in field.values.shape]
    fine = np.pad(field.values, margins, mode="edge")
    values = fine[::share, ::share, ::share]
    # What is thinner than the distance of nodes that are left would be lost between them.
    deepest = ndimage.minimum_filter(fine, 2 * (share // 2) + 1)[::share, ::share, ::share]
    near: Array = ndimage.binary_dilation(values < 0, np.ones((3, 3, 3)))
    thin: Array = (deepest < 0) & np.logical_not(near)
    for axis in range(3):
        np.moveaxis(thin, axis, 0)[[0, -1]] = False
    return SignedDistanceField(
        origin=field.origin, spacing=share * field.spacing, values=np.where(thin, deepest, values)
    )


def _table(field: SignedDistanceField) -> bytes:
    steps = np.clip(field.values * (_STEPS / field.spacing), -_FARTHEST, _FARTHEST)
    # What is outside, or inside, stays so: rounded to nothing it would be on the surface.
    numbers = (np.sign(steps) * np.ceil(np.abs(steps) - 0.5).clip(1)).astype(np.int64)
    return encoded(numbers.reshape(-1, numbers.shape[2]))


def _field_of(entry: Mapping[str, Any], fetch: Callable[[int], bytes]) -> SignedDistanceField:
    nodes = _nodes_of(entry)
    numbers, rest = decoded(memoryview(fetch(4 * math.prod(nodes) + 1)), nodes[0] * nodes[1], nodes[2])
    if len(rest):
        raise ValueError("its field is longer than it says")
    spacing = float(entry["spacing"])
    return SignedDistanceField(
        origin=tuple(entry["origin"]), spacing=spacing, values=(numbers * (spacing / _STEPS)).reshape(nodes)
    )


def _nodes_of(entry: Mapping[str, Any]) -> list[int]:
    nodes = [int(count) for count in entry["nodes"]]
    if len(nodes) != 3 or min(nodes) < 2:
        raise ValueError(f"a field of {nodes} nodes")
    return nodes


def _poses(collider: Collider, times: Array) -> bytes:
    """(F, 7): where the center is, and the orientation as a quaternion (w, x, y, z)."""
    from scipy.spatial.transform import Rotation

    assert collider.motion is not None
    poses = [pose_of(collider.motion, float(time)) for time in times]
    turns = Rotation.from_matrix([pose.rotation for pose in poses]).as_quat()
    return np.column_stack([[pose.place for pose in poses], np.roll(turns, 1, axis=1)]).astype("<f8").tobytes()


def _motion_of(center: Sequence[float], poses: bytes, times: Array) -> KeyframedMotion:
    if len(poses) != 8 * _POSE * len(times):
        raise ValueError("its poses are cut off")
    rows = np.frombuffer(poses, "<f8").reshape(-1, _POSE)
    return KeyframedMotion(
        times=tuple(times.tolist()),
        places=cast("Any", rows[:, :3].copy()),
        quaternions=cast("Any", rows[:, 3:].copy()),
        center=cast("Any", tuple(center)),
    )

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
_MOST_NODES = 160
"""Of a field, along an axis: what a picture shows, and less than any graphics card must take."""
_LARGEST_FIELD = 1 << 24
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
    """
    entries: list[Entry] = []
    files: dict[str, bytes] = {}
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
    for number, entry in enumerate(entries):
        kind, name = entry.get("kind"), f"{number}/"
        if kind not in (*_FORMULAS, _FIELD):
            continue
        try:
            shape = (
                _field_of(entry, lambda most, name=name: fetch(name + "field", most))
                if kind == _FIELD
                else _FORMULAS[kind](**{key: entry[key] for key in _names(_FORMULAS[kind])})
            )
            motion = None
            if "moves" in entry:
                motion = _motion_of(entry["moves"], fetch(name + "poses", 8 * _POSE * len(times)), times)
            found.append(Collider(shape=shape, side=Side(entry["side"]), motion=motion))
        except (KeyError, TypeError, ValueError, SceneError) as error:
            told = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            raise ValueError(f"collider {number + 1} is damaged: {told}") from error
    return tuple(found)


def _names(shape: type[Shape]) -> list[str]:
    return [field.name for field in dataclasses.fields(cast("Any", shape))]


def _coarse(field: SignedDistanceField) -> SignedDistanceField:
    """The same with no more nodes along an axis than a picture needs."""
    share = math.ceil((max(field.values.shape) - 1) / (_MOST_NODES - 2))
    if share == 1:
        return field
    # Whole steps along every axis, so that the outermost nodes are outside still.
    margins = [(0, -(count - 1) % share) for count in field.values.shape]
    values = np.pad(field.values, margins, mode="edge")[::share, ::share, ::share]
    return SignedDistanceField(origin=field.origin, spacing=share * field.spacing, values=values)


def _table(field: SignedDistanceField) -> bytes:
    steps = np.clip(field.values * (_STEPS / field.spacing), -_FARTHEST, _FARTHEST)
    # What is outside stays so: rounded to nothing it would be on the surface.
    numbers = np.where(steps > 0, np.maximum(np.round(steps), 1), np.round(steps)).astype(np.int64)
    return encoded(numbers.reshape(-1, numbers.shape[2]))


def _field_of(entry: Mapping[str, Any], fetch: Callable[[int], bytes]) -> SignedDistanceField:
    nodes = [int(count) for count in entry["nodes"]]
    if len(nodes) != 3 or min(nodes) < 2 or math.prod(nodes) > _LARGEST_FIELD:
        raise ValueError(f"a field of {nodes} nodes")
    numbers, rest = decoded(memoryview(fetch(4 * math.prod(nodes) + 1)), nodes[0] * nodes[1], nodes[2])
    if len(rest):
        raise ValueError("its field is longer than it says")
    spacing = float(entry["spacing"])
    return SignedDistanceField(
        origin=tuple(entry["origin"]), spacing=spacing, values=(numbers * (spacing / _STEPS)).reshape(nodes)
    )


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

"""What of a scene decides its frames, as one number.

Only what differs from the defaults enters: a field that is added tomorrow, with a default that leaves scenes what they
were, does not make today's recordings those of another scene.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, cast

from gasp_core.contract import Collider, EngineAccuracy
from gasp_core.gaussians import Gaussians
from gasp_core.scene.columns import Column, PlyProperty
from gasp_core.scene.file_shapes import FileShape, known_by_content
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import PythonMotion
from gasp_core.scene.objects import SplatObject, UpAxis, with_columns
from gasp_core.scene.placement import up_axis
from gasp_core.scene.schema import SCHEMA
from gasp_core.scene.settings import EngineChoice, RecordingChoice
from gasp_core.scene.writing import MEMORY

__all__ = ["scene_digest", "what_differs"]


def scene_digest(scene: Scene, sources: Sequence[str]) -> str:
    """SHA-256 of what decides the frames of a scene: not how many there are, nor where its files lie.

    Parameters
    ----------
    scene
        Also one that a recording has kept.
    sources
        SHA-256 of each object's splat, of its columns, and of the function it moves by.
    """
    deciding = dataclasses.replace(
        scene,
        colliders=tuple(_collider(one) for one in scene.colliders),
        duration=1 / scene.frame_rate,
        engine=EngineChoice(),  # compared by itself, so that one can say what differs
        recording=RecordingChoice(),
        camera=None,
        accuracy=dataclasses.replace(scene.accuracy, substep_limit=EngineAccuracy().substep_limit),
    )
    told = what_differs(deciding)
    told["objects"] = [_object(item, source) for item, source in zip(scene.objects, sources)]
    return hashlib.sha256(json.dumps({"schema": SCHEMA, **told}, sort_keys=True).encode()).hexdigest()


def what_differs(owner: Any) -> dict[str, Any]:
    """Fields of a dataclass that are not at their defaults, as JSON values; with its kind where it has one.

    What makes no difference to its class, a name for messages, makes none here.
    """
    told: dict[str, Any] = {}
    for field in dataclasses.fields(owner):
        if not field.compare:
            continue
        value = getattr(owner, field.name)
        if field.default is not dataclasses.MISSING:
            at_default = bool(value == field.default)
        elif field.default_factory is not dataclasses.MISSING:
            at_default = bool(value == field.default_factory())
        else:
            at_default = False
        if not at_default:
            told[field.name] = _plain(value)
    kind = getattr(owner, "kind", None)
    return {"kind": kind, **told} if kind else told


def _collider(collider: Collider) -> Collider:
    """By the content of its file, wherever that lies."""
    known = known_by_content(collider)
    if not isinstance(known.shape, FileShape):
        return known
    shape = dataclasses.replace(known.shape, file=Path(known.shape.sha256), sha256="")
    return dataclasses.replace(known, shape=shape)


def _object(item: SplatObject, source: str) -> dict[str, Any]:
    motion = item.motion
    if isinstance(motion, PythonMotion):
        # What the function does, the digest of the object's source knows; where it lies decides nothing.
        motion = dataclasses.replace(motion, function="any:function")
    reduction = item.reduction
    if reduction.mesh is not None:
        reduction = dataclasses.replace(reduction, mesh=Path("any"))
    item = with_columns(dataclasses.replace(item, motion=motion, up=_up(item), reduction=reduction), _anywhere)
    return what_differs(dataclasses.replace(item, splat=Path(source)))


def _anywhere(column: Column) -> Column:
    """What is in a file, the digest of the object's source knows; where it lies decides nothing."""
    return column if isinstance(column, PlyProperty) else Path("any.npy")


def _up(item: SplatObject) -> UpAxis:
    """As `up_axis`, also where a recording has kept no more than the mark of Gaussians that were in memory."""
    marked = isinstance(item.splat, Path) and str(item.splat).startswith(MEMORY)
    return item.up or "+z" if marked else up_axis(item)


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, (Path, Gaussians)):
        return str(value) if isinstance(value, Path) else ""
    if dataclasses.is_dataclass(value):
        return what_differs(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in cast("Mapping[Any, Any]", value).items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in cast("list[Any]", value)]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        # 400 and 400.0 are the same density, and so are 0.0 and -0.0.
        return float(value) + 0.0
    return value if value is None or isinstance(value, (bool, str)) else str(value)

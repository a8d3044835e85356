"""What a recording keeps of bodies that move by themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.dynamics.composition import PrescribedMotion
from gasp_core.errors import RecordingError
from gasp_core.recording.layout import BodyEntry, ObjectEntry
from gasp_core.recording.store import Store
from gasp_core.reduction.all_vertices import Block
from gasp_core.scene.loading import read_stored_motion
from gasp_core.scene.placement import Placement

__all__ = ["driven_rows", "formula_of", "placement_of"]

Array = NDArray[Any]


def driven_rows(store: Store, index: int, entry: BodyEntry, count: int) -> Array | None:
    """Which of the `count` Gaussians of body `index` go where they move by themselves; None where none does.

    Raises
    ------
    RecordingError
        Where they are damaged.
    """
    name = f"bodies/{index}/driven"
    if not store.has(name):
        return None
    driven = store.array(name, (None,), "i")
    if not (entry.drifts and len(driven) and driven[0] >= 0 and driven[-1] < count and (np.diff(driven) > 0).all()):
        raise RecordingError(f"{store.root}: {name} is damaged: it names no rows of the body, rising")
    return driven


def formula_of(
    store: Store, index: int, entry: BodyEntry, item: ObjectEntry, block: Block, driven: Array | None
) -> PrescribedMotion | None:
    """The motion of body `index`, where a formula tells it; of its `driven` Gaussians alone, if there are any.

    Raises
    ------
    RecordingError, SceneError
        Where it is damaged.
    """
    name = f"bodies/{index}/unmoved"
    if not store.has(name):
        return None
    choice = read_stored_motion(entry.motion or {}, file=f"{store.root} (motion)")
    rest = block.rest if driven is None else block.rest[driven]
    unmoved = store.array(name, rest.shape, "f")
    return PrescribedMotion.again(item.name, choice, unmoved, placement_of(store, item).translation, rest)


def placement_of(store: Store, item: ObjectEntry) -> Placement:
    """Where an object was put.

    Raises
    ------
    RecordingError
        Where a recording is too old to say so.
    """
    if item.placement is None:
        raise RecordingError(f"{store.root}: does not say how its objects were placed, it is too old: run it anew")
    values = item.placement
    return Placement(
        rotation=np.array(values["rotation"], dtype=np.float64),
        scale=float(values["scale"]),
        translation=np.array(values["translation"], dtype=np.float64),
    )

"""What a session goes on from: checkpoints come out of files, and may be of another scene, damaged, or made to harm."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import SceneError

__all__ = ["checkpoint_arrays"]

Array = NDArray[Any]

_ADVICE = "it is damaged, or of another scene or engine; start the run anew"


def checkpoint_arrays(
    checkpoint: Mapping[str, Array],
    expected: Mapping[str, tuple[int, ...]],
    engine: str,
    *,
    may_be_nan: Collection[str] = (),
) -> dict[str, Array]:
    """Arrays of a checkpoint as numbers that an engine can take.

    Parameters
    ----------
    checkpoint
        As `open` was given it; what is not expected in it is passed over.
    expected
        Shapes of the arrays, by their names.
    engine
        Its name, for messages.
    may_be_nan
        Names of the arrays in which NaN says something, such as that a point is not held; infinite is nothing ever.

    Returns
    -------
    dict
        Copies, of the type that they were kept in.

    Raises
    ------
    SceneError
        Where one is missing, of another shape, of anything but numbers and truths, or not finite.
    """
    arrays: dict[str, Array] = {}
    for name, shape in expected.items():
        kept = np.array(checkpoint[name]) if name in checkpoint else None
        found = "nothing" if kept is None else kept.shape
        if kept is None or found != shape:
            raise SceneError(f"{engine}: the checkpoint holds {found} for {name}, expected {shape}: {_ADVICE}")
        if kept.dtype.kind not in "biuf":
            raise SceneError(f"{engine}: the checkpoint holds no numbers for {name}, but {kept.dtype}: {_ADVICE}")
        if np.isinf(kept).any() or (name not in may_be_nan and np.isnan(kept).any()):
            raise SceneError(f"{engine}: the checkpoint holds numbers that are not finite for {name}: {_ADVICE}")
        arrays[name] = kept
    return arrays

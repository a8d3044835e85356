"""The triangles between the points of a body, for engines that step sheets by their faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_core.contract.validation import frozen_array
from gasp_core.errors import SceneError

__all__ = ["BodyFaces", "body_faces"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFaces:
    """A body is a sheet, and its points are the corners of these faces: a hint of `PointProblem.hints`.

    How thick it is follows from the volumes of its points and the area of the faces.

    Parameters
    ----------
    body
        Its number in `PointCloud.body_ids`.
    faces : (F, 3)
        Rows of the problem's points.
    """

    body: int
    faces: Array

    def __post_init__(self) -> None:
        frozen_array(self, "faces", (None, 3), np.int64, what="face")


def body_faces(problem: PointProblem) -> dict[int, Array]:
    """The faces (F, 3) of the bodies of a problem that are known, by their numbers.

    Raises
    ------
    SceneError
        Where a face has corners that are not three points of its body, a point of it is in no face, or a body has two
        such hints.
    """
    found: dict[int, Array] = {}
    ids = problem.points.body_ids
    for hint in problem.hints:
        if not isinstance(hint, BodyFaces):
            continue
        body, faces = hint.body, hint.faces
        if body in found:
            raise SceneError(f"body {body} has two BodyFaces: join them")
        if faces.size and (faces.min() < 0 or faces.max() >= len(ids) or (ids[faces] != body).any()):
            raise SceneError(f"BodyFaces of body {body} have corners that are no points of it")
        if (faces == np.roll(faces, 1, axis=1)).any():
            raise SceneError(f"BodyFaces of body {body} have faces of fewer than three corners")
        alone = np.setdiff1d(np.flatnonzero(ids == body), faces)
        if len(alone):
            raise SceneError(f"BodyFaces of body {body}: {len(alone)} of its points are in no face, first {alone[0]}")
        found[body] = faces
    return found

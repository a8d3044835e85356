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
        Where a face has corners that are not points of its body.
    """
    found = {hint.body: hint.faces for hint in problem.hints if isinstance(hint, BodyFaces)}
    ids = problem.points.body_ids
    for body, faces in found.items():
        if faces.size and (faces.min() < 0 or faces.max() >= len(ids) or (ids[faces] != body).any()):
            raise SceneError(f"BodyFaces of body {body} have corners that are no points of it")
    return found

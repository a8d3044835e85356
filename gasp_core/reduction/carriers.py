"""The ways in which points carry Gaussians, by the names that recordings know them by."""

from __future__ import annotations

from collections.abc import Mapping

from gasp_core.reduction.all_vertices import Vertices
from gasp_core.reduction.attached import Attached
from gasp_core.reduction.centres import Centres
from gasp_core.reduction.cores import Levels
from gasp_core.reduction.mesh import OnFaces
from gasp_core.reduction.point_frames import PointFrames

__all__ = ["CARRIERS"]

CARRIERS: Mapping[str, type[Vertices | Centres | Attached | Levels | OnFaces | PointFrames]] = {
    kind.kind: kind for kind in (Vertices, Centres, Attached, Levels, OnFaces, PointFrames)
}

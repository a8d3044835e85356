"""Hands packed frames to viser: one node for each kind, of which one is visible."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from gasp_viewer.faces import FACE, PackedFaces
from gasp_viewer.layers import Packed, PackedPoints
from gasp_viewer.packing import FINENESS, PackedSplats

__all__ = ["Display"]


class Display:
    """The nodes of what is shown.

    Parameters
    ----------
    server
        Whose scene they are in.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._nodes: dict[type, Any] = {}

    def show(self, packed: Packed) -> None:
        """Show this and nothing else."""
        kind = type(packed)
        # All of it reaches the page in one go: no frame with old colours on new positions.
        with self._server.atomic():
            if kind not in self._nodes:
                self._nodes[kind] = self._made(packed)
            node = self._nodes[kind]
            match packed:
                case PackedSplats():
                    node.buffer = packed.buffer
                case PackedFaces():
                    node.batched_positions = packed.positions
                    node.batched_wxyzs = packed.quaternions
                    node.batched_scales = packed.scales
                    node.batched_colors = packed.colours
                case PackedPoints():
                    node.points = packed.points
                    node.colors = packed.colours
            for other, handle in self._nodes.items():
                if handle.visible != (other is kind):
                    handle.visible = other is kind

    def _made(self, packed: Packed) -> Any:
        scene = self._server.scene
        match packed:
            case PackedSplats():
                count = len(packed.buffer)
                return scene.add_gaussian_splats(
                    "/gaussians",
                    centers=np.zeros((count, 3)),
                    covariances=np.zeros((count, 3, 3)),
                    rgbs=np.zeros((count, 3)),
                    opacities=np.zeros((count, 1)),
                    scale=1 / FINENESS,
                )
            case PackedFaces():
                vertices, faces = FACE
                return scene.add_batched_meshes_simple(
                    "/triangles",
                    vertices,
                    faces,
                    packed.quaternions,
                    packed.positions,
                    batched_scales=packed.scales,
                    batched_colors=packed.colours,
                    lod="off",
                    side="double",
                    flat_shading=True,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            case PackedPoints():
                return scene.add_point_cloud(
                    "/points",
                    packed.points,
                    packed.colours,
                    point_size=packed.size,
                    point_shape="circle",
                    precision="float32",
                )

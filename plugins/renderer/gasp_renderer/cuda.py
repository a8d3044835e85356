# pyright: basic
# gsplat and torch are optional and carry no types where they are not installed.
"""The renderer "gsplat": the rasteriser of gsplat (Ye et al. 2024, arXiv 2409.06765) on an NVIDIA GPU.

Written against gsplat 1.5.3 and tested with a stand-in that records what it is asked for; it has not been run on a GPU.

Two things differ from the image model. gsplat knows no occluders: a Gaussian whose mean is behind the occluder in the
pixel it projects to is left out everywhere, others are drawn everywhere. And gsplat draws no Gaussian beyond 3.33
standard deviations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera
from gasp_core.rendering.contract import LOW_PASS, Picture
from gasp_renderer.inputs import checked_inputs, checked_occluders

__all__ = ["GsplatRenderer", "hidden"]

Array = NDArray[Any]

_FAR = 1e30
"""The contract has no far plane; gsplat wants one."""


class GsplatRenderer:
    """Draws splats with gsplat.

    Raises
    ------
    RenderingError
        Where gsplat or torch are not installed, or torch finds no GPU.
    """

    def __init__(self) -> None:
        try:
            import gsplat  # pyright: ignore[reportMissingImports]
            import torch  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise RenderingError(
                f'the renderer "gsplat" cannot be imported ({error}): pip install "gasp-renderer[cuda]" or take "numba"'
            ) from error
        if not torch.cuda.is_available():
            raise RenderingError('the renderer "gsplat" needs an NVIDIA GPU and torch finds none: take "numba" instead')
        self._gsplat, self._torch = gsplat, torch

    def render(self, splats: RenderInput, camera: Camera, *, occluders: Array | None = None) -> Picture:
        """Draw splats on a transparent ground; see `SplatRenderer.render`."""
        walls = checked_occluders(occluders, camera)
        inputs = checked_inputs(splats)
        if len(splats) == 0:
            return Picture(
                colour=np.zeros((camera.height, camera.width, 3), np.float32),
                alpha=np.zeros((camera.height, camera.width), np.float32),
                depth=np.full((camera.height, camera.width), np.inf, np.float32),
            )
        gsplat, torch = self._gsplat, self._torch

        def upload(array: Array) -> Any:
            return torch.tensor(array, dtype=torch.float32, device="cuda")

        # Around the eye, so that float32 is enough wherever the scene stands.
        eye = camera.position
        view, lens = np.eye(4), np.eye(3)
        view[:3, :3], view[:3, 3] = camera.rotation, camera.translation + camera.rotation @ eye
        lens[:2] = (camera.focal_x, 0, camera.center_x), (0, camera.focal_y, camera.center_y)
        shown = inputs.opacities
        if len(walls):
            # gsplat itself leaves out what is below the floor of alpha.
            shown = np.where(hidden(inputs.means, camera, walls), 0, shown)
        try:
            means = upload(inputs.means - eye)
            directions = means
            if len(inputs.turns):
                directions = torch.einsum("nji,nj->ni", upload(inputs.turns), means)
            colours = gsplat.spherical_harmonics(splats.sh_degree, directions, upload(inputs.harmonics)) + 0.5
            if len(inputs.covariances):
                shape = {
                    "quats": None,
                    "scales": None,
                    "covars": upload(inputs.covariances[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]),
                }
            else:
                # gsplat divides by the length: one of length zero turns nothing.
                turning = np.any(inputs.quaternions, axis=1, keepdims=True)
                shape = {
                    "quats": upload(np.where(turning, inputs.quaternions, [1, 0, 0, 0])),
                    "scales": upload(inputs.scales),
                    "covars": None,
                }
            drawn, alpha, _ = gsplat.rasterization(
                means=means,
                opacities=upload(shown),
                colors=torch.clamp(colours, min=0),
                viewmats=upload(view[None]),
                Ks=upload(lens[None]),
                width=camera.width,
                height=camera.height,
                near_plane=camera.near,
                far_plane=_FAR,
                eps2d=LOW_PASS,
                packed=False,
                render_mode="RGB+ED",
                **shape,
            )
            drawn, alpha = drawn[0].cpu().numpy(), alpha[0, :, :, 0].cpu().numpy()
        except torch.cuda.OutOfMemoryError as error:
            raise RenderingError(
                f"{camera.width} x {camera.height} pixels and {len(splats):,} Gaussians do not fit on the GPU:"
                " draw a smaller picture or fewer Gaussians"
            ) from error
        return Picture(
            colour=np.ascontiguousarray(drawn[:, :, :3]),
            alpha=alpha,
            depth=np.where(alpha > 0, drawn[:, :, 3], np.float32(np.inf)),
        )


def hidden(means: Array, camera: Camera, walls: Array) -> Array:
    """Which means (N, 3) are behind the wall (H, W) in the pixel they project to, (N,) bool; outside of it none are."""
    places, depths = camera.project(means)
    # NaN and inf, of means in the plane of the eye, are outside as well.
    inside = ((places >= 0) & (places < (camera.width, camera.height))).all(axis=1) & (depths > 0)
    columns, rows = places[inside].astype(np.intp).T
    behind = np.zeros(len(means), bool)
    behind[inside] = depths[inside] > walls[rows, columns]
    return behind

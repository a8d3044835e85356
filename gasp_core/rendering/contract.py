"""What a renderer of splats is: the hook `gasp_splat_renderers` offers factories, which make a `SplatRenderer`.

The image model is that of 3DGS (Kerbl et al. 2023, 10.1145/3592433), stated here so that renderers agree:

- EWA projection (Zwicker et al. 2001): covariance J R Sigma R^T J^T + 0.3 px^2 I, J the Jacobian of the perspective
  division at the mean, whose x/z and y/z are clamped to 0.3 half-images beyond the edges;
- a Gaussian nearer than `Camera.near` along the axis of view is not drawn;
- alpha = min(0.999, opacity exp(-d^2 / 2)) at pixel centres; below 1/255 it is 0;
- colour max(0, 0.5 + harmonics(R^T d)), d the unit direction from the eye to the mean, R the matter's turn;
- before something opaque at depth D in a pixel there is, of a Gaussian's optical depth -log(1 - alpha), the part that
  is nearer: alpha' = 1 - (1 - alpha)^Phi((D - m) / s). Along the ray z r, r = (x, y, 1), the density of a Gaussian with
  mean mu and covariance S in the camera's frame is normal, with m = r^T S^-1 mu / r^T S^-1 r, s^2 = 1 / r^T S^-1 r; the
  0.3 px^2 are added to S as wide as a pixel is at the mean;
- front to back in the order of the means' depths, weights w_i = alpha_i prod_{j < i} (1 - alpha_j).

Colours are display values, as splats are trained on: no gamma anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera

__all__ = ["ALPHA_FLOOR", "ALPHA_LIMIT", "LOW_PASS", "Picture", "SplatRenderer"]

Array = NDArray[Any]

LOW_PASS = 0.3
"""Variance [px^2] added to every projected Gaussian, so that none falls between pixels."""
ALPHA_LIMIT = 0.999
"""Largest alpha of one Gaussian at one pixel."""
ALPHA_FLOOR = 1 / 255
"""Below this alpha a Gaussian leaves a pixel alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture with transparency.

    Parameters
    ----------
    colour : (H, W, 3) float32
        Sum of w_i c_i: premultiplied by alpha. May exceed 1.
    alpha : (H, W) float32
        Sum of w_i, 0..1.
    depth : (H, W) float32
        Mean depth along the axis of view, sum w_i z_i / sum w_i, in the world's unit; inf where alpha is 0.
    """

    colour: Array
    alpha: Array
    depth: Array

    def over(self, background: Array) -> Array:
        """The picture (H, W, 3) float32 over an opaque background: one colour (3,) or an image (H, W, 3)."""
        return self.colour + (1 - self.alpha[:, :, None]) * np.asarray(background, dtype=np.float32)

    def before(self, behind: Picture) -> Picture:
        """This picture in front of another, which is seen where this one is transparent."""
        share = 1 - self.alpha
        return Picture(
            colour=self.colour + share[:, :, None] * behind.colour,
            alpha=self.alpha + share * behind.alpha,
            depth=np.where(self.alpha > 0, self.depth, behind.depth),
        )


class SplatRenderer(Protocol):
    """Draws splats; made once, used for many pictures, from one thread at a time."""

    def render(self, splats: RenderInput, camera: Camera, *, occluders: Array | None = None) -> Picture:
        """Draw splats on a transparent ground.

        Parameters
        ----------
        splats
            Any number, zero too.
        camera
            From where, and how large.
        occluders : (H, W)
            Depth along the axis of view at which something opaque stands in each pixel, inf where nothing does: what
            is behind it is not drawn there, of a Gaussian that reaches through it as much as is.

        Raises
        ------
        RenderingError
            Where splats are not finite, or the picture does not fit in memory.
        """
        ...

"""Gaussians as the bytes viser's page draws: packed once a frame, then only handed over.

A Gaussian is eight uint32: its centre as three float32, one word the page keeps for itself, the six upper entries of
its covariance (xx xy xz yy yz zz) as float16, and red, green, blue, opacity as bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import rotation_matrices
from gasp_core.render_input import RenderInput
from gasp_viewer.display_units import Stage

__all__ = ["FINENESS", "HALF_MAX", "HALF_ROUNDING", "HALF_STEP", "PackedSplats", "covariances", "pack_splats"]

Array = NDArray[Any]

FINENESS = 100.0
"""What is packed is so many times as large as the stage, and the node it hangs on so many times smaller.

float16 ends at 65504 and steps by 6e-8 near zero. On a stage 2.5 across, 100 puts deviations from 1e-6 of what is shown
to all of it between the two; at 1, everything thinner than 1e-4 would vanish.
"""

HALF_MAX = 65504.0
"""Largest float16."""
HALF_ROUNDING = 2.0**-11
"""Relative rounding error of a normal float16."""
HALF_STEP = 2.0**-25
"""Absolute rounding error of a subnormal one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedSplats:
    """Gaussians for `viser.GaussianSplatHandle.buffer`, in units of 1 / `FINENESS` of the stage's.

    Parameters
    ----------
    buffer : (N, 8) uint32
    """

    buffer: Array

    @property
    def nbytes(self) -> int:
        """Memory it takes."""
        return self.buffer.nbytes


def covariances(splats: RenderInput) -> Array:
    """Covariances (N, 6), xx xy xz yy yz zz, float64, of splats of either description."""
    if splats.covariances is not None:
        return splats.covariances.astype(np.float64)
    assert splats.quaternions is not None and splats.scales is not None  # RenderInput refuses to have neither
    axes = rotation_matrices(splats.quaternions) * splats.scales.astype(np.float64)[:, None, :]
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    return np.stack([np.einsum("nk,nk->n", axes[:, i], axes[:, j]) for i, j in pairs], axis=1)


def pack_splats(splats: RenderInput, colours: Array, stage: Stage) -> PackedSplats:
    """Pack Gaussians.

    A covariance rounded entry by entry may have a negative eigenvalue, and the page throws such a Gaussian away. The
    rounding D - fl(D) of D = S + f I is at most u |D| + v in every entry (u = `HALF_ROUNDING`, v = `HALF_STEP`), so
    its norm is at most u (tr S + sqrt(3) f) + 3 v; with f equal to that, the result is never negative. The thinnest
    axis of a disc is drawn no thinner than 1/32 of its radius by it. One too large for float16 is shrunk as a whole.

    Parameters
    ----------
    splats
        N Gaussians in the world.
    colours : (N, 3)
        In 0..1; what is outside is cut off.
    stage
        Where they are shown.
    """
    buffer = np.zeros((len(splats), 8), dtype=np.uint32)
    buffer[:, :3] = (FINENESS * stage.place(splats.means)).astype(np.float32).view(np.uint32)
    six = covariances(splats) * (FINENESS * stage.unit) ** 2
    # The largest entry of a covariance is one of its diagonal; the floor adds less than 2^-9 of it.
    six *= np.minimum(1.0, (1 - 2.0**-9) * HALF_MAX / six.max(axis=1, initial=1.0))[:, None]
    trace = six[:, 0] + six[:, 3] + six[:, 5]
    floor = (HALF_ROUNDING * trace + 3 * HALF_STEP) / (1 - 3**0.5 * HALF_ROUNDING)
    six[:, [0, 3, 5]] += floor[:, None]
    buffer[:, 4:7] = six.astype(np.float16).view(np.uint32)
    rgba = np.concatenate([colours, splats.opacities[:, None]], axis=1)
    buffer[:, 7:] = np.rint(np.clip(rgba, 0.0, 1.0) * 255).astype(np.uint8).view(np.uint32)
    return PackedSplats(buffer=buffer)

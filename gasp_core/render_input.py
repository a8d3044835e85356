"""What is drawn: Gaussians as they are now, with the colour they were trained with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.gaussians import Gaussians

__all__ = ["RenderInput"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderInput:
    """N Gaussians to be drawn: shapes of the moment, harmonics as trained, and how far the matter has turned since.

    Turning the direction of view is one 3x3 product a Gaussian and exact; turning coefficients is for export.

    Parameters
    ----------
    means : (N, 3)
        Centres, in the world.
    opacities : (N,)
        In 0..1.
    harmonics : (N, (d + 1)^2, 3)
        Coefficients of degree d = 0..4 in the 3DGS basis, for view directions in the frame they were trained in.
    quaternions : (N, 4), scales : (N, 3)
        Rotation w x y z (of any length but zero) and standard deviations; None where `covariances` are given.
    covariances : (N, 6)
        xx xy xz yy yz zz instead.
    turns : (N, 3, 3)
        Rotation R of each Gaussian's matter since its harmonics were trained: in direction d it shows the colour
        harmonics(R^T d). None: not turned.

    Raises
    ------
    RenderingError
        Where shapes do not belong together, or neither or both of the two descriptions of shape are given.
    """

    means: Array
    opacities: Array
    harmonics: Array
    quaternions: Array | None = None
    scales: Array | None = None
    covariances: Array | None = None
    turns: Array | None = None

    def __post_init__(self) -> None:
        by_axes = (self.quaternions is not None, self.scales is not None)
        if by_axes[0] != by_axes[1] or (self.covariances is not None) == by_axes[0]:
            raise RenderingError("RenderInput need either quaternions and scales, or covariances")
        count = len(self.means)
        expected: dict[str, tuple[int, ...]] = {
            "means": (count, 3),
            "opacities": (count,),
            "quaternions": (count, 4),
            "scales": (count, 3),
            "covariances": (count, 6),
            "turns": (count, 3, 3),
        }
        for name, shape in expected.items():
            value = getattr(self, name)
            if value is None:
                continue
            object.__setattr__(self, name, np.asarray(value))
            found = getattr(self, name).shape
            if found != shape:
                raise RenderingError(f"RenderInput.{name} has shape {found}, expected {shape}")
        object.__setattr__(self, "harmonics", np.asarray(self.harmonics))
        shape = self.harmonics.shape
        if len(shape) != 3 or shape[0] != count or shape[2] != 3 or shape[1] not in (1, 4, 9, 16, 25):
            raise RenderingError(
                f"RenderInput.harmonics has shape {shape}, expected ({count}, K, 3) with K = 1, 4, 9, 16, 25"
            )

    def with_round(self, means: Array, scales: Array, opacities: Array, colours: Array) -> RenderInput:
        """These, and round Gaussians behind them, of one colour from all sides.

        Parameters
        ----------
        means : (G, 3)
        scales : (G,)
            Standard deviations.
        opacities : (G,)
        colours : (G, 3)
            Constant coefficients in the 3DGS basis.

        Raises
        ------
        RenderingError
            Where these are given by covariances.
        """
        if self.quaternions is None or self.scales is None:
            raise RenderingError("RenderInput.with_round needs Gaussians with quaternions and scales")
        count = len(means)
        harmonics = np.zeros((count, *self.harmonics.shape[1:]), dtype=self.harmonics.dtype)
        harmonics[:, 0] = colours
        turns = self.turns
        return RenderInput(
            means=np.concatenate([self.means, means]),
            opacities=np.concatenate([self.opacities, opacities]),
            harmonics=np.concatenate([self.harmonics, harmonics]),
            quaternions=np.concatenate([self.quaternions, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))]),
            scales=np.concatenate([self.scales, np.repeat(scales[:, None], 3, axis=1)]),
            turns=None if turns is None else np.concatenate([turns, np.broadcast_to(np.eye(3), (count, 3, 3))]),
        )

    @classmethod
    def of(cls, gaussians: Gaussians) -> RenderInput:
        """Gaussians whose harmonics belong to the frame they stand in."""
        return cls(
            means=gaussians.means,
            opacities=gaussians.opacities,
            harmonics=gaussians.harmonics,
            quaternions=gaussians.quaternions,
            scales=gaussians.scales,
        )

    def select(self, rows: Array | slice) -> RenderInput:
        """Some of them: a mask, numbers or a slice of rows."""
        optional = ("quaternions", "scales", "covariances", "turns")
        chosen = {name: getattr(self, name) for name in optional}
        return RenderInput(
            means=self.means[rows],
            opacities=self.opacities[rows],
            harmonics=self.harmonics[rows],
            **{name: None if values is None else values[rows] for name, values in chosen.items()},
        )

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics."""
        return round(self.harmonics.shape[1] ** 0.5) - 1

"""A trained D-MiSo: its cores at rest, what is attached to them, and where both are at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from gasp_core.dynamics.d_miso.folder import CheckpointFiles, find_checkpoint, read_arguments
from gasp_core.dynamics.d_miso.networks import CoreNetwork, TurnNetwork
from gasp_core.gaussians import Gaussians, rotation_matrices, rotation_quaternions
from gasp_core.io.activations import sigmoid
from gasp_core.io.format_errors import malformed
from gasp_core.io.torch_archives import read_archive

__all__ = ["Checkpoint", "read_checkpoint"]

Array = NDArray[Any]

_THICKNESS = 1e-8
"""Of a core across its triangle, and added to lengths, as the published code has it; in the unit of the scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """Cores, K Gaussians attached to each, and what moves them.

    Parameters
    ----------
    cores : (C, 3, 3)
        Triangles at rest, first the mean.
    offsets : (C, K, 3)
        From the core's mean, along its normal and its two edges, all of length one.
    scale_factors : (C, K, 3)
        Of the scales of the core.
    turns : (C K, 4)
        What is learnt for the network that turns Gaussians.
    opacities : (C K,)
        In 0..1.
    harmonics : (C K, H, 3)
    core_network, turn_network
        Of the time.
    """

    cores: Array
    offsets: Array
    scale_factors: Array
    turns: Array
    opacities: Array
    harmonics: Array
    core_network: CoreNetwork
    turn_network: TurnNetwork

    def __len__(self) -> int:
        return len(self.opacities)

    def cores_at(self, time: float) -> Array:
        """Triangles of the cores (C, 3, 3) at a time from 0 to 1.

        v1' = v1 + d1, and v_i' = v_i + d1 + unit(R (v_i - v1)) d_i, product by component, as it was trained: what R
        turns is the direction in which an edge grows, not the edge.
        """
        mean, second, third, turn = self.core_network(self.cores, time)
        rotations = rotation_matrices(turn)
        moved = self.cores + mean[:, None]
        for vertex, lengthening in ((1, second), (2, third)):
            edges = np.einsum("cij,cj->ci", rotations, self.cores[:, vertex] - self.cores[:, 0])
            moved[:, vertex] += edges / np.linalg.norm(edges, axis=1, keepdims=True) * lengthening
        return moved

    def at(self, time: float) -> Gaussians:
        """The Gaussians at a time from 0 to 1, float64, harmonics as they were trained."""
        cores = self.cores_at(time)
        second, third = cores[:, 1] - cores[:, 0], cores[:, 2] - cores[:, 0]
        # The frame is orthogonal, what Gaussians are put along is not.
        along_second, along_third = _unit(second), _unit(third)
        normals = _unit(np.cross(along_second, along_third))
        other = _unit(third - _along(third, normals) - _along(third, along_second))
        frames = np.stack([normals, along_second, other], axis=2)
        lengths = np.stack(
            [
                np.full(len(cores), _THICKNESS),
                np.linalg.norm(second, axis=1) + _THICKNESS,
                np.abs(np.einsum("ci,ci->c", third, other)),
            ],
            axis=1,
        )
        edges = np.stack([normals, along_second, along_third], axis=1)
        attached = self.offsets.shape[1]
        of_cores = np.repeat(rotation_quaternions(frames), attached, axis=0)
        return Gaussians(
            means=(cores[:, None, 0] + self.offsets @ edges).reshape(-1, 3),
            quaternions=_product(self.turn_network(self.turns, time), of_cores),
            scales=(self.scale_factors * lengths[:, None]).reshape(-1, 3),
            opacities=self.opacities,
            harmonics=self.harmonics,
        )


def read_checkpoint(folder: Path, iteration: str | None = None) -> tuple[Checkpoint, CheckpointFiles]:
    """The checkpoint in the folder of a trained D-MiSo, and the files it was read from.

    Parameters
    ----------
    folder
        With cfg_args, point_cloud, deform and time_net in it.
    iteration
        "best" or a number; None: the best where it was kept, else the last.

    Raises
    ------
    SplatFormatError
        Where a file is missing, damaged, of another model, or names code.
    """
    files = find_checkpoint(folder, iteration)
    model = _Model(files.model, read_archive(files.model))
    if model.value("use_attached_gauss", True) is not True or not model.has("alpha"):
        raise malformed(
            files.model,
            "has cores alone, nothing is attached to them yet",
            "take an iteration that was kept after training went over to attached Gaussians",
        )
    cores = model.array("pseudomesh", (None, 3, 3))
    offsets = model.array("alpha", (len(cores), None, 3))
    attached = offsets.shape[1]
    count = len(cores) * attached
    if not count:
        raise malformed(files.model, "holds no Gaussians")
    edges = np.linalg.norm(cores[:, 1:] - cores[:, :1], axis=2)
    if not (edges > 0).all():
        raise malformed(files.model, f"{int((edges == 0).any(axis=1).sum())} of its {len(cores)} cores have no edges")
    constant = model.array("attached_features_dc", (count, 1, 3))
    others = model.array("attached_features_rest", (count, None, 3))
    if others.shape[1] not in (0, 3, 8, 15, 24):
        raise malformed(files.model, f"has {1 + others.shape[1]} harmonics of each Gaussian, which is no degree")
    core_network = CoreNetwork.of(read_archive(files.deformation), _refusing(files.deformation))
    turn_network = TurnNetwork.of(read_archive(files.turns), core_network.time_frequencies, _refusing(files.turns))
    if files.arguments is not None:
        _compare(files.arguments, core_network)
    with np.errstate(over="ignore"):
        factors = np.exp(model.array("attached_scale", (count, 3)))
    if not np.isfinite(factors).all():
        raise malformed(files.model, "has scales beyond what numbers hold")
    checkpoint = Checkpoint(
        cores=cores,
        offsets=offsets,
        scale_factors=factors.reshape(len(cores), attached, 3),
        turns=model.array("attached_rotation", (count, 4)),
        opacities=sigmoid(model.array("attached_opacity", (count, 1))[:, 0]),
        harmonics=np.concatenate([constant, others], axis=1).astype(np.float32),
        core_network=core_network,
        turn_network=turn_network,
    )
    return checkpoint, files


class _Model:
    """What is saved beside the networks, each array checked as it is taken."""

    def __init__(self, path: Path, values: Any) -> None:
        if not isinstance(values, Mapping):
            raise malformed(path, "holds no parameters of a model")
        self._path = path
        self._values: Mapping[str, Any] = values

    def has(self, name: str) -> bool:
        return name in self._values

    def value(self, name: str, default: Any) -> Any:
        return self._values.get(name, default)

    def array(self, name: str, shape: tuple[int | None, ...]) -> Array:
        """float64; None in the shape stands for any length."""
        found = self._values.get(name)
        expected = " x ".join("any" if length is None else str(length) for length in shape)
        if not isinstance(found, np.ndarray) or found.dtype.kind != "f":
            raise malformed(self._path, f"has no {name}, numbers {expected}", "fetch it again, or train it anew")
        if found.ndim != len(shape) or any(b is not None and a != b for a, b in zip(found.shape, shape)):
            raise malformed(self._path, f"its {name} is {' x '.join(map(str, found.shape))}, not {expected}")
        if not np.isfinite(found).all():
            bad = int((~np.isfinite(found)).sum())
            raise malformed(self._path, f"{bad} numbers of its {name} are not finite", "take another iteration")
        return found.astype(np.float64)


def _refusing(path: Path) -> Any:
    def refuse(what: str) -> NoReturn:
        raise malformed(path, what, "the folder is not that of one model of D-MiSo: fetch it again")

    return refuse


def _compare(path: Path, network: CoreNetwork) -> None:
    """Refuse networks that are not those that were trained."""
    told = read_arguments(path).get("is_blender")
    synthetic = bool(network.time_layers)
    if told is not None and bool(told) != synthetic:
        has = "has a network of the time" if synthetic else "has no network of the time"
        raise malformed(
            path, f"says is_blender={told}, but deform.pth {has}", "the files are of different models: fetch them again"
        )


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _along(vectors: Array, directions: Array) -> Array:
    return np.einsum("ci,ci->c", vectors, directions)[:, None] * directions


def _product(left: Array, right: Array) -> Array:
    """Of quaternions (N, 4): the right one turns first."""
    w, v = left[:, :1], left[:, 1:]
    other, u = right[:, :1], right[:, 1:]
    scalar = w * other - np.einsum("ni,ni->n", v, u)[:, None]
    return np.concatenate([scalar, w * u + other * v + np.cross(v, u)], axis=1)

"""The scenes that the recordings of earlier versions were made from, as one builds them today."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from swaying import sway

from gasp_core import (
    Elastic,
    EngineChoice,
    Gaussians,
    MapChoice,
    PythonMotion,
    RecordingChoice,
    Reduction,
    Scene,
    SplatObject,
    Wave,
)
from gasp_core.contract import EngineAccuracy

JELLY = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)


def scene(version: int) -> Scene:
    """The scene of a version, with what recordings of that version were the first to have.

    Every vertex is a point, there are 64 cells, and steps are half of the stable bound where nothing else is said, as
    it was by default up to version 6.
    """
    return Scene(
        duration=0.24,
        frame_rate=25,
        objects=tuple(_sampled(item) for item in (STILL, *_moving(version))),
        engine=EngineChoice(name="ballistic", options={"spin": 3.0}),
        accuracy=EngineAccuracy(resolution=64, substep_fraction=0.5),
        maps=_maps(version),
        recording=RecordingChoice(checkpoint_frames=1, velocities=version == 1),
    )


def cloud(seed: int, *, flat: bool) -> Gaussians:
    """24 Gaussians in a cube, whose colours depend on the direction of view.

    Only uniform numbers: numpy's other distributions and functions may end in another digit on another processor, and a
    recording knows its splats to the last bit.
    """
    draw = np.random.default_rng(seed)
    scales = draw.uniform(0.01, 0.1, size=(24, 3))
    if flat:
        scales[:, 2] = 1e-5
    return Gaussians(
        means=draw.uniform(-0.5, 0.5, size=(24, 3)),
        quaternions=draw.uniform(-1, 1, size=(24, 4)),
        scales=scales,
        opacities=draw.uniform(0.2, 1, size=24),
        harmonics=draw.uniform(-1, 1, size=(24, 4, 3)),
    )


STILL = SplatObject(name="still", splat=cloud(1, flat=False), static=True)


def _sampled(item: SplatObject) -> SplatObject:
    kept = item.static or item.reduction.mode == "cores"
    return item if kept else dataclasses.replace(item, reduction=Reduction(mode="all"))


def _moving(version: int) -> tuple[SplatObject, ...]:
    if version == 1:
        return (
            SplatObject(name="round", splat=cloud(2, flat=False), material=JELLY, angular_velocity=(0, 0, 2)),
            SplatObject(name="flat", splat=cloud(3, flat=True), material=JELLY, position=(2, 0, 1)),
        )
    if version == 2:
        fit, frame = Reduction(mode="cores", count=12, levels=2), Reduction(mode="cores", count=6, transfer="frame")
        return (
            SplatObject(name="whole", splat=cloud(2, flat=True), material=JELLY, angular_velocity=(0, 0, 2)),
            SplatObject(name="fit", splat=cloud(4, flat=False), material=JELLY, position=(2, 0, 1), reduction=fit),
            SplatObject(name="frame", splat=cloud(5, flat=False), material=JELLY, position=(4, 0, 1), reduction=frame),
        )
    wave = Wave(axis=(1, 0, 0), amplitude=0.1, frequency=2, wavelength=1.5, direction=(0, 0, 1))
    motion = PythonMotion(function=sway)
    moved = (
        SplatObject(name="wave", splat=cloud(2, flat=False), material=JELLY, position=(2, 0, 1), motion=wave),
        SplatObject(name="sway", splat=cloud(3, flat=True), material=JELLY, position=(4, 0, 1), motion=motion),
    )
    if version == 3:
        return moved
    cores = Reduction(mode="cores", count=12)
    return (
        *moved,
        SplatObject(name="fit", splat=cloud(4, flat=False), material=JELLY, position=(6, 0, 1), reduction=cores),
    )


def _maps(version: int) -> MapChoice:
    """Once each other than by default: what a frame is read with stood in the scene alone up to version 4."""
    chosen = {
        3: MapChoice(alpha=math.inf),
        4: MapChoice(alpha=1.05, covariance="gram_schmidt"),
        5: MapChoice(alpha=math.inf, covariance="gram_schmidt"),
        6: MapChoice(alpha=1.05, covariance="gram_schmidt", control="as_printed"),
    }
    return chosen.get(version, MapChoice())

"""V17: a body force of our own making, under which the motion is known whatever the material does.

The contract has no force that differs from point to point. It has impulses, and they are as good: one a substep and a
layer of points, on a box that moves with the layer as is prescribed, is how any body force enters an explicit engine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_conformance import oracles
from gasp_conformance.clouds import POINTS_PER_CELL, point_volume
from gasp_conformance.scenes import SharedScene, shared_scene
from gasp_conformance.subject import Subject
from gasp_core.contract import BoxShape, Impulse, NeoHookean

__all__ = ["bar_is_made_to_move"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Prescribed:
    """The motion, and the layers of points that are pushed into it.

    Parameters
    ----------
    layers : (M,)
        Places X of the layers, from the bar's end, in its length.
    mass
        Of a layer [kg].
    """

    scene: SharedScene
    material: NeoHookean
    layers: Array
    mass: float
    speed: float
    amplitude: float

    def displacements(self, time: float) -> Array:
        """Of the layers, (M,) [m]."""
        return oracles.manufactured_displacement(self.layers, time, self.amplitude, self.speed)

    def impulses(self, time: float, duration: float, width: float) -> list[Impulse]:
        """What the body force gives to each layer, `width` [m] apart, in `duration` [s]."""
        force = oracles.manufactured_body_force(
            self.layers,
            time,
            self.amplitude,
            self.speed,
            self.material.density,
            self.material.shear_modulus,
            self.material.lame_lambda,
        )
        places = self.scene.bodies[0].corner[0] + self.layers + self.displacements(time)
        # Half as wide as a layer's share: room for the engine's error, and none for a neighbour.
        half = (width / 4, 1.0, 1.0)
        _, y, z = self.scene.bodies[0].corner
        return [
            Impulse(
                region=BoxShape(center=(float(place), y, z), half_extents=half),
                start=time,
                impulse=(float(self.mass * duration * own), 0.0, 0.0),
            )
            for place, own in zip(places, force)
        ]


def bar_is_made_to_move(subject: Subject, cells: int) -> float:
    """V17: how far a neo-Hookean bar between slip walls is at most from u = A cos(pi X) sin(c pi t) within a period.

    Root mean square over its points, in amplitudes A.
    """
    scene = shared_scene("v17_manufactured")
    numbers, material, spacing = scene.numbers, scene.material, scene.spacing(cells)
    assert isinstance(material, NeoHookean), scene.name
    (bar,) = scene.places(cells)
    along = bar[:, 0] - scene.bodies[0].corner[0]
    width = spacing / POINTS_PER_CELL
    layers = (np.arange(cells * POINTS_PER_CELL) + 0.5) * width
    prescribed = _Prescribed(
        scene=scene,
        material=material,
        layers=layers,
        mass=material.density * point_volume(spacing) * len(bar) / len(layers),
        speed=oracles.bar_speed(material.youngs_modulus, material.density),
        amplitude=numbers["amplitude"],
    )
    end = numbers["periods"] * 2 / prescribed.speed
    frames = round(numbers["frames"])
    # A whole number of substeps a frame, so that each begins at an impulse and none is cut.
    count = frames * math.ceil(end / (frames * scene.fixed_substep(cells)))
    step = end / count
    begins = np.arange(count) * step
    drives = [push for time in begins for push in prescribed.impulses(float(time), step, width)]
    velocities = np.zeros_like(bar)
    velocities[:, 0] = prescribed.amplitude * prescribed.speed * np.pi * np.cos(np.pi * along)
    problem = replace(scene.problem(cells, [velocities]), colliders=scene.side_walls(cells, "yz"))
    # A hair above the step, which as a difference of two times has its own rounding.
    accuracy = replace(scene.accuracy(cells), substep=step * (1 + 1e-6))
    times = np.append(begins[count // frames :: count // frames], end)

    worst = 0.0
    for state in subject.states(replace(problem, drives=tuple(drives)), accuracy, times):
        exact = oracles.manufactured_displacement(along, state.time, prescribed.amplitude, prescribed.speed)
        off = state.positions - bar
        off[:, 0] -= exact
        worst = max(worst, math.sqrt(float(np.mean(np.sum(off**2, axis=1)))))
    return worst / prescribed.amplitude

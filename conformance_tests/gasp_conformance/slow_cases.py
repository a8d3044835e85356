"""A bar that is drawn out slowly and let go, run through the contract; it measures and does not judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gasp_conformance import oracles
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.observables import mode_amplitude
from gasp_conformance.specimens import NO_GRAVITY
from gasp_conformance.subject import Subject
from gasp_core.contract import Driven, Elastic, EngineAccuracy, Field, HalfSpace, Pinned, PointProblem

__all__ = ["CELLS", "Drawn", "bar_is_drawn_slowly"]

CELLS = 6
"""Along the bar."""
_STRAIN, _TIMES = 1e-4, 300
_CORNER = np.array([0.37, 0.21, 0.11])


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """What there is of a bar's strain.

    Parameters
    ----------
    by_gradients
        The mean of F_xx - 1 in the middle of the bar, over the strain that the points there show; NaN where the engine
        shows no F.
    swing
        How far it goes to the other side when it is let go, over how far it was drawn.
    substep_count
        Taken to draw it.
    """

    by_gradients: float
    swing: float
    substep_count: int


def bar_is_drawn_slowly(subject: Subject) -> Drawn:
    """A bar, held at one end, is drawn at the other for as long as sound takes to go through it some 300 times.

    Its strain of 1e-4 grows by less in a step than a float32 knows beside 1.
    """
    spacing = 1 / CELLS
    material = Elastic(density=1000.0, youngs_modulus=1e6, poissons_ratio=0.0)
    passage = 1.0 / oracles.bar_speed(material.youngs_modulus, material.density)
    duration = _TIMES * passage
    bar = box_of_points(_CORNER, (CELLS, 1, 1), spacing)
    low, high = _CORNER[0] + spacing / 2, _CORNER[0] + 1 - spacing / 2
    problem = PointProblem(
        points=cloud_of([bar], [np.zeros(3)], spacing),
        materials=(material,),
        gravity=NO_GRAVITY,
        drives=(
            Pinned(region=HalfSpace(point=(low, 0.0, 0.0), normal=(1.0, 0.0, 0.0))),
            Driven(
                region=HalfSpace(point=(high, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
                velocity=(_STRAIN / duration, 0.0, 0.0),
                end=duration,
            ),
        ),
    )
    shown = subject.descriptor.capabilities.output_fields & {Field.DEFORMATION_GRADIENTS}
    # The first mode of what is left free, a quarter of a wave, swings there and back in four passages.
    times = np.append(duration, duration + np.linspace(0.0, 4.0, 41)[1:] * passage)
    middle = (bar[:, 0] > low + spacing) & (bar[:, 0] < high - spacing)
    shape = np.clip((bar[:, 0] - low) / (1 - spacing), 0.0, 1.0)
    gradients, amplitudes = np.nan, list[float]()
    with subject.open(problem, EngineAccuracy(spacing=spacing, substep_limit=1_000_000), shown) as session:
        count = session.advance_to(duration).substep_count
        for time in times:
            if time > duration:
                session.advance_to(time)
            state = session.read(frozenset({Field.POSITIONS}) | shown)
            drawn = state.positions[:, 0] - bar[:, 0]
            if time == duration and state.deformation_gradients is not None:
                strain = float(np.polyfit(bar[middle, 0], drawn[middle], 1)[0])
                gradients = float((state.deformation_gradients[middle, 0, 0] - 1).mean()) / strain
            amplitudes.append(mode_amplitude(drawn, shape))
    assert amplitudes[0] != 0, "the bar is not drawn at all: its driven end does not pull, or the rest does not follow"
    return Drawn(by_gradients=gradients, swing=-min(amplitudes) / amplitudes[0], substep_count=count)

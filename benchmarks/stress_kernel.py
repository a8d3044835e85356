"""Why stress acts as it does: the two choices of `gasp_core.stepping.mpm`, each varied in the reference engine.

A cantilever that bends by a quarter of its length under its own weight (V7, K = 2), by the share of the splines' own
gradient in the kernel of the stress; what is left of its error: how much goes with points that are twice as close, and
with where the clamp lies on the grid, by how many times what it holds counts; and a short one of growing Poisson's
ratio (V6), by how the dilation is averaged. About a quarter of an hour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import gasp_conformance.clouds as clouds
import gasp_reference_mpm.material_points as matter
import gasp_reference_mpm.transfer as transfer
import numpy as np
from gasp_conformance.cases import beam_hangs
from gasp_conformance.clouds import box_of_points, cloud_of
from gasp_conformance.extreme_cases import beam_swings
from gasp_conformance.oracles import cantilever_deflection
from gasp_conformance.scenes import shared_scene
from gasp_conformance.subject import Subject, find_subject

from gasp_core.contract import Elastic, EngineAccuracy, PointProblem, Precision, Trajectories
from gasp_core.stepping import held_matter
from gasp_core.stepping.grid import GridAnchor

SHIFTS = (0.0, 0.25, 0.5, 0.75)
SHARES = (0.0, 0.25, 0.5, 1.0)
CELLS = (24, 48)
RATIOS = (0.4, 0.45, 0.49, 0.499)


@contextmanager
def replaced(module: Any, name: str, value: Any) -> Iterator[None]:
    """The module with another value under a name, for as long as it lasts."""
    usual = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, usual)


def bending(subject: Subject) -> None:
    """Error of the drop of the tip, by share and by cells along the length (an eighth of them across it)."""
    scene = shared_scene("v7_bent")
    print("drop of the tip of a hanging beam, error [%]")
    print("share of the gradient " + "".join(f"{f'{cells // 8} cells thick':>16}" for cells in CELLS))
    for share in SHARES:
        with replaced(transfer, "GRADIENT_SHARE", share):
            errors = [100 * beam_hangs(subject, scene, cells).drop_error for cells in CELLS]
        print(f"{share:<22}" + "".join(f"{error:16.1f}" for error in errors), flush=True)


def rest(subject: Subject) -> None:
    """What is left of the error of the drop, at the share that is taken."""
    scene = shared_scene("v7_bent")
    print("\ndrop of the tip of a hanging beam, error [%]")
    print("cells thick    as it is   4^3 points a cell")
    for thick in (3, 6, 12):
        cells = 8 * thick
        plain = 100 * beam_hangs(subject, scene, cells).drop_error
        with replaced(clouds, "POINTS_PER_CELL", 4):
            closer = 100 * beam_hangs(subject, scene, cells).drop_error
        print(f"{thick:<11}{plain:12.1f}{closer:20.1f}", flush=True)


@dataclass(frozen=True)
class Shifted:
    """A subject whose grid lies elsewhere."""

    subject: Subject
    anchor: GridAnchor

    def __getattr__(self, name: str) -> Any:
        return getattr(self.subject, name)

    def states(self, problem: PointProblem, *given: Any) -> Any:
        """As of `Subject`."""
        return self.subject.states(replace(problem, hints=(self.anchor,)), *given)


def clamp(subject: Subject) -> None:
    """Error of the drop by where the clamp's plane is between nodes, and by how many times held matter counts."""
    scene = shared_scene("v7_bent")
    print("\ndrop of the tip of a hanging beam, error [%]; the clamp's plane is so many cells before a node")
    print("cells thick    counted" + "".join(f"{shift:>9}" for shift in SHIFTS))
    for thick in (2, 3, 6):
        for times in (1.0, held_matter.HELD_FIRMNESS):
            with replaced(held_matter, "HELD_FIRMNESS", times):
                drops = [
                    100 * beam_hangs(Shifted(subject, anchor), scene, 8 * thick).drop_error  # type: ignore[arg-type]
                    for anchor in (GridAnchor(place=(shift * scene.spacing(8 * thick), 0, 0)) for shift in SHIFTS)
                ]
            print(f"{thick:<11}{times:11g}" + "".join(f"{drop:9.1f}" for drop in drops), flush=True)


def hanging_on_led(subject: Subject) -> None:
    """How far a bar swings that hangs on points which are led and stand, by how many times they count."""
    density, gravity, spacing, weight = 1000.0, 1.0, 0.1, 0.4
    print("\nlargest drop of the tip of a bar that hangs on led points, over twice that at rest, - 1 [%]")
    print("cells thick    counted    error")
    for thick in (2, 4):
        free = 4 * thick
        length, height = free * spacing, thick * spacing
        modulus = 12 * density * gravity * length**3 / (weight * height**2)
        bar = box_of_points((0.0, 0.0, 0.0), (free + 3, thick, thick), spacing)
        rows = np.flatnonzero(bar[:, 0] < 3 * spacing)
        period = 2 * np.pi * length**2 / (1.0149 * height) * np.sqrt(density / modulus)
        times = np.linspace(0.0, 0.7 * period, 29)
        still = Trajectories(rows=rows, times=times, displacements=np.zeros((len(times), len(rows), 3)))
        problem = PointProblem(
            points=cloud_of([bar], [(0.0, 0.0, 0.0)], spacing),
            materials=(Elastic(density=density, youngs_modulus=modulus, poissons_ratio=0.0),),
            gravity=(0.0, 0.0, -gravity),
            trajectories=still,
        )
        tip = bar[:, 0] > bar[:, 0].max() - spacing / 4
        place = float(bar[tip, 0].mean()) / length - 3 * spacing / length
        rest = length * float(cantilever_deflection(place, weight, length / height))
        for counted in (1.0, held_matter.HELD_FIRMNESS):
            with replaced(held_matter, "HELD_FIRMNESS", counted):
                states = subject.states(problem, EngineAccuracy(spacing=spacing), list(times[1:]))
                drops = [float((bar - state.positions)[tip, 2].mean()) for state in states]
            print(f"{thick:<11}{counted:11g}{100 * (max(drops) / (2 * rest) - 1):9.1f}", flush=True)


def locking(subject: Subject, cells: int) -> None:
    """Mean drop of a beam over that at 0.3, with the dilation of every point its own and averaged."""
    print(f"\nmean drop of a beam {cells} cells thick, over that at Poisson's ratio 0.3, - 1 [%]")
    print("Poisson's ratio       " + "".join(f"{ratio:>8}" for ratio in RATIOS))
    usual, _ = beam_swings(subject, 0.3, cells)
    ways: dict[str, Callable[..., Any]] = {"its own": lambda *given: given[-1], "averaged": transfer.local_means}
    for name, mean in ways.items():
        with replaced(matter, "local_means", mean):
            drops = [100 * (beam_swings(subject, ratio, cells)[0] / usual - 1) for ratio in RATIOS]
        print(f"dilation {name:<13}" + "".join(f"{drop:8.1f}" for drop in drops), flush=True)


if __name__ == "__main__":
    engine = find_subject("reference-mpm", None, None)
    bending(engine)
    # The same numbers, sooner.
    sooner = find_subject("warp-mpm", Precision.FLOAT64, None)
    rest(sooner)
    clamp(sooner)
    hanging_on_led(sooner)
    for thickness in (2, 3):
        locking(engine, thickness)

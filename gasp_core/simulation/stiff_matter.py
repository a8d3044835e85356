"""Matter too stiff for an engine that steps explicitly: said before anything is opened, with what to do instead."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from gasp_core.contract import (
    Elastic,
    EngineAccuracy,
    EngineDescriptor,
    Fluid,
    Material,
    Metal,
    NeoHookean,
    PointProblem,
    Rigid,
)
from gasp_core.contract.capabilities import needs, unmet
from gasp_core.errors import SceneError, UnsupportedSceneError
from gasp_core.quantities import length_told
from gasp_core.scene.presets import find_preset
from gasp_core.simulation.deflection import UNSEEN, Load, load_of, meeting_speed, softened

__all__ = ["refuse_too_stiff"]


def refuse_too_stiff(
    problem: PointProblem,
    descriptor: EngineDescriptor,
    accuracy: EngineAccuracy,
    *,
    frame_step: float,
    duration: float,
    body_names: Sequence[str] = (),
    others: Iterable[EngineDescriptor] = (),
) -> None:
    """Refuse a scene of which one frame would take an engine more substeps than it may.

    An engine that does not tell its `EngineCapabilities.stable_step` is asked nothing, nor is one whose step the scene
    has fixed: it says so itself.

    Parameters
    ----------
    problem
        The scene as the engine would get it.
    descriptor
        The engine.
    accuracy
        As the engine would get it, with a spacing.
    frame_step, duration
        From frame to frame, and of all of it [s].
    body_names
        Names of the bodies 0, 1, 2, ... for the message.
    others
        All installed engines: those that could do it are named.

    Raises
    ------
    UnsupportedSceneError
        In one line: which matter takes how many substeps, and what would take fewer.
    """
    stable_step = descriptor.capabilities.stable_step
    if stable_step is None or accuracy.substep is not None:
        return
    spacing = accuracy.spacing_for(problem.points.size)

    def substeps(*materials: Material) -> int:
        """For a frame of matter at rest: what moves or is deformed takes more."""
        step = accuracy.substep_fraction * min(stable_step(material, spacing) for material in materials)
        return math.ceil(frame_step / step * (1 - 1e-9)) if math.isfinite(step) else 1

    used = [int(row) for row in np.unique(problem.points.material_ids)]
    worst = max(used, key=lambda row: substeps(problem.materials[row]))
    material, needed = problem.materials[worst], substeps(problem.materials[worst])
    if needed <= accuracy.substep_limit:
        return
    bodies = _bodies_of(problem, worst)
    installed = [other for other in others if other.name != descriptor.name]
    too_many = (
        f"{descriptor.name} would need {needed:,} substeps of {frame_step / needed:.3g} s for each frame on cells of"
        f" {length_told(spacing)}, and substep_limit under [accuracy] is {accuracy.substep_limit:,}: "
    )
    undamped = substeps(dataclasses.replace(material, stiffness_damping=0.0)) if _is_damped(material) else needed
    if undamped <= accuracy.substep_limit:
        ways = [
            "say less of it, or mass_damping instead, which costs no steps",
            _other_engines(problem, worst, installed),
            "take a coarser resolution, or raise substep_limit",
        ]
        raise UnsupportedSceneError(
            f"{too_many}without the stiffness_damping{_of_objects(bodies, body_names)} it would be {undamped:,}."
            f" Either {'; or '.join(way for way in ways if way)}"
        )
    speed = meeting_speed(problem, duration)
    loads = [load_of(problem, body, speed) for body in bodies]
    others_too = [row for row in used if row != worst and substeps(problem.materials[row]) > accuracy.substep_limit]
    rest = [problem.materials[row] for row in used if row != worst and row not in others_too]
    ways = [
        _rigid(problem, worst, descriptor, installed),
        _softer(material, loads, needed, accuracy.substep_limit, partial(substeps, *rest)),
        _other_engines(problem, worst, installed),
        "take a coarser resolution, or raise substep_limit",
    ]
    also = "".join(f", and so is{_of_objects(_bodies_of(problem, row), body_names)[3:]}" for row in others_too)
    raise UnsupportedSceneError(
        f"{too_many}{_told(material)}{_of_objects(bodies, body_names)} is that stiff{also if body_names else ''}."
        f" Either {'; or '.join(way for way in ways if way)}"
    )


def _is_damped(material: Material) -> bool:
    return isinstance(material, (Elastic, NeoHookean)) and material.stiffness_damping > 0


def _bodies_of(problem: PointProblem, row: int) -> list[int]:
    """The bodies with points of a material."""
    return [int(body) for body in np.unique(problem.points.body_ids[problem.points.material_ids == row])]


def _rigid(problem: PointProblem, row: int, descriptor: EngineDescriptor, installed: Sequence[EngineDescriptor]) -> str:
    """Who would take it for a body that does not deform; nothing where nobody would, or it flows."""
    material = problem.materials[row]
    if not isinstance(material, (Elastic, NeoHookean, Metal)):
        return ""
    changed = _with_material(problem, row, Rigid(density=material.density))
    own = not unmet(needs(changed), descriptor.capabilities)
    able = [descriptor.name] if own else _able(changed, installed)
    if not able:
        return ""
    said = _written(material, 'model = "rigid"')
    return f"say {said} with {' or '.join(able)}: it does not deform then"


def _softer(
    material: Material, loads: Sequence[Load], needed: int, limit: int, substeps: Callable[[Material], int]
) -> str:
    """The lower modulus that nobody sees, and what it takes; nothing where that is too much as well."""
    for speed, whole in ((None, True), (0.0, False)):
        borne = [load if speed is None else dataclasses.replace(load, speed=speed) for load in loads]
        found = [softened(material, load) for load in borne]
        softer = max((each for each in found if each is not None), key=_modulus, default=None)
        if softer is None or None in found or substeps(softer) > limit:
            continue
        name = "bulk_modulus" if isinstance(material, Fluid) else "youngs_modulus"
        kept = (
            "keeps its density to 1 %"
            if isinstance(material, Fluid)
            else f"keeps its deflection below {UNSEEN:g} of its size"
        )
        loads_told = _loads_told(softer, loads, whole)
        return (
            f"say {_written(material, f'{name} = {_pascals(_modulus(softer))}')}, which {kept}{loads_told}"
            f" and needs {substeps(softer):,} substeps rather than {needed:,}"
        )
    return ""


def _loads_told(softer: Material, loads: Sequence[Load], whole: bool) -> str:
    """Under which loads a softer material does what it is said to do, and what it does under the others."""
    speed = max(load.speed for load in loads)
    if isinstance(softer, Fluid) or speed == 0:
        return "" if isinstance(softer, Fluid) else " under its own weight"
    if whole:
        return f" under its own weight, and as it is stopped at {speed:.2g} m/s,"
    recoil = max(load.recoil(softer.density, _modulus(softer)) for load in loads)
    return f" under its own weight (for a moment by up to {100 * recoil:.2g} % as it is stopped at {speed:.2g} m/s)"


def _other_engines(problem: PointProblem, row: int, installed: Sequence[EngineDescriptor]) -> str:
    """Engines whose steps no stiffness shortens, with the material as it is, or else as an elastic one."""
    free = [other for other in installed if other.capabilities.unconditionally_stable]
    material = problem.materials[row]
    able = _able(problem, free)
    if able:
        return f"take {' or '.join(able)}, whose steps no stiffness shortens"
    if isinstance(material, (NeoHookean, Metal)):
        elastic = Elastic(
            density=material.density, youngs_modulus=material.youngs_modulus, poissons_ratio=material.poissons_ratio
        )
        able = _able(_with_material(problem, row, elastic), free)
        if able:
            said = _written(material, 'model = "elastic"')
            return f"say {said} with {' or '.join(able)}, whose steps no stiffness shortens"
    return ""


def _able(problem: PointProblem, engines: Iterable[EngineDescriptor]) -> list[str]:
    asked = needs(problem)
    return sorted(engine.name for engine in engines if not unmet(asked, engine.capabilities))


def _with_material(problem: PointProblem, row: int, material: Material) -> PointProblem:
    materials = [material if index == row else each for index, each in enumerate(problem.materials)]
    return dataclasses.replace(problem, materials=tuple(materials))


def _modulus(material: Material) -> float:
    return material.bulk_modulus if isinstance(material, Fluid) else getattr(material, "youngs_modulus", math.inf)


def _told(material: Material) -> str:
    symbol = "K" if isinstance(material, Fluid) else "E"
    modulus = f"{symbol} = {_pascals(_modulus(material))} Pa"
    return f'"{material.name}" ({material.kind}, {modulus})' if material.name else f"{material.kind} of {modulus}"


def _of_objects(bodies: Sequence[int], names: Sequence[str]) -> str:
    named = [f'"{names[body]}"' for body in bodies if 0 <= body < len(names)]
    more = f" and {len(named) - 3} more" if len(named) > 3 else ""
    return f" of object {', '.join(named[:3])}{more}" if named else ""


def _written(material: Material, change: str) -> str:
    """A change of a material as a scene file has it."""
    try:
        preset = find_preset(material.name)
    except SceneError:
        return change
    return f'material = {{ preset = "{preset.name}", {change} }}'


def _pascals(value: float) -> str:
    """2.1e11, as one writes it."""
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa

"""What a recording says of the run it is of."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract.options import chosen_options
from gasp_core.games import FLATNESS, flatten
from gasp_core.recording.layout import BodyEntry, EngineRecord, Header, ObjectEntry
from gasp_core.recording.map_record import map_record
from gasp_core.reduction.bodies import Body
from gasp_core.scene.digest import scene_digest
from gasp_core.scene.file_shapes import known_by_content
from gasp_core.scene.model import Scene
from gasp_core.scene.writing import motion_table, scene_to_toml
from gasp_core.simulation.engine_choice import ChosenEngine, distribution_version
from gasp_core.simulation.initial_overlap import starts_in_another, starts_inside
from gasp_core.simulation.oddities import oddities, own_contact
from gasp_core.simulation.splat_sources import Prepared

__all__ = ["header_of"]

Array = NDArray[Any]


def _flattening(body: Body) -> str:
    """What triangles leave out of Gaussians that are not flat; nothing where they leave out nothing one could see."""
    if body.block.vertices == 4:
        return ""
    lost = flatten(body.block.local).lost_share
    thick = lost > FLATNESS**2
    if not thick.any():
        return ""
    return (
        f'object "{body.name}": {int(thick.sum())} of {len(thick)} Gaussians are not flat; a triangle does not carry'
        f" their thinnest axis ({100 * float(np.median(lost[thick])):.1f} % of the variance in the median):"
        " it keeps its length and stands on the triangle (vertices = 4: it moves too)"
    )


def header_of(
    scene: Scene,
    whole: Scene,
    path: Path,
    prepared: Prepared,
    chosen: ChosenEngine,
    options: Any,
    notes_on_engine: Sequence[str],
) -> Header:
    """The header of the recording at a path, of a scene, part of a `whole` one, that an engine runs with these
    options."""
    assembly = prepared.assembly
    told = dataclasses.replace(scene, colliders=tuple(known_by_content(one) for one in scene.colliders))
    ends = np.cumsum([0, *(len(placed.gaussians) for placed in prepared.objects)])
    rows = {placed.item.name: index for index, placed in enumerate(prepared.objects)}
    capabilities = chosen.descriptor.capabilities
    notes = [*notes_on_engine]
    for placed in prepared.objects:
        notes += placed.set_aside.sentences(placed.item.name, static=placed.item.static)
        notes += placed.told_components()
    notes += [note for body in assembly.bodies if (note := _flattening(body))]
    notes += [f'object "{body.name}": {note}' for body in assembly.bodies for note in body.notes]
    notes += assembly.notes
    notes += oddities(whole, prepared.objects, assembly)
    notes += own_contact(assembly.problem, chosen.descriptor)
    inside = [*starts_inside(assembly.problem, assembly.spacing, assembly.colliders)]
    if chosen.descriptor.capabilities.bodies_meet:
        inside += starts_in_another(assembly.problem, assembly.spacing, assembly.body_names)
    notes += [f'object "{assembly.body_names[number]}": {note}' for number, note in inside]
    return Header(
        gasp_version=distribution_version("gasp-core"),
        scene=scene_to_toml(told, path.absolute().parent),
        scene_digest=scene_digest(told, prepared.digests),
        points_digest=hashlib.sha256(assembly.problem.points.reference_positions.tobytes()).hexdigest(),
        frame_rate=scene.frame_rate,
        spacing=assembly.spacing,
        maps=map_record(scene.maps),
        objects=tuple(
            ObjectEntry(
                name=placed.item.name,
                first=int(ends[index]),
                last=int(ends[index + 1]),
                splat_digest=digest,
                set_aside=dataclasses.asdict(placed.set_aside),
                placement={
                    "rotation": placed.placement.rotation.tolist(),
                    "scale": placed.placement.scale,
                    "translation": placed.placement.translation.tolist(),
                },
            )
            for index, (placed, digest) in enumerate(zip(prepared.objects, prepared.digests))
        ),
        bodies=tuple(
            BodyEntry(
                item=rows[body.name],
                vertices=body.block.vertices,
                first=body.points.start,
                last=body.points.stop,
                carrier=body.carrier.kind,
                drifts=body.drift is not None or body.strained,
                motion=_formula(body),
            )
            for body in assembly.bodies
        ),
        notes=tuple(notes),
        engine=EngineRecord(
            name=chosen.descriptor.name,
            version=chosen.version,
            device=scene.engine.device or capabilities.devices[0],
            precision=(scene.engine.precision or capabilities.precisions[0]).value,
            seed=scene.engine.seed,
            options=chosen_options(options),
            checkpoints=capabilities.checkpoints,
        ),
    )


def _formula(body: Body) -> dict[str, Any] | None:
    """The motion of a body that moves by itself and whose motion a formula tells."""
    if body.drift is None or not body.drift.has_formula:
        return None
    return motion_table(body.drift.played.choice)

"""From placed objects to the one problem an engine is given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Drive, EngineAccuracy, Material, PointCloud, PointProblem
from gasp_core.dynamics.composition import Played, PrescribedMotion
from gasp_core.dynamics.mesh_at_start import mesh_at_start
from gasp_core.errors import SceneError
from gasp_core.quantities import length_told
from gasp_core.reduction.all_vertices import Block, block_of, rigid_velocities, sample_all
from gasp_core.reduction.attached import Attached
from gasp_core.reduction.bodies import Body
from gasp_core.reduction.centres import sample_centres
from gasp_core.reduction.choosing import Choice, chosen_mode, chosen_resolution, reduction_of, size_of
from gasp_core.reduction.cores import Levels, sample_cores
from gasp_core.reduction.leading import Lead, driven_gaussians, trajectories_at_rest
from gasp_core.reduction.mesh import OnFaces, sample_mesh
from gasp_core.reduction.part_points import matter_of_points
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.reduction.surfaces import colliders_of, rigid_surfaces
from gasp_core.reduction.transfer_operator import Sample, TransferOperator
from gasp_core.reduction.volume import sample_volume
from gasp_core.scene.body_contacts import default_contact, pair_contacts
from gasp_core.scene.model import Scene
from gasp_core.scene.objects import Reduction
from gasp_core.scene.selection import PlacedObject
from gasp_core.stepping.body_faces import BodyFaces
from gasp_core.stepping.grid import GridAnchor

__all__ = ["Assembly", "assemble"]

Array = NDArray[Any]

_FINEST, _COARSEST = 1e-12, 1e12
"""Of a cell [m]: the cube of what is beyond them is no float32."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """The problem and what its points stand for.

    Parameters
    ----------
    problem
        For the engine.
    spacing
        Grid spacing [m], from the points before they were magnified.
    bodies
        An object each, in the order of `PointCloud.body_ids`; behind them these have the objects' rigid parts.
    accuracy
        What the engine is given: that of the scene, with this spacing and a resolution that is a number.
    colliders
        What a user would call those of the problem.
    notes
        Sentences for the user about all of it.
    pinned
        What the last of the problem's drives hold, behind those of the scene.
    leads
        What drives its points, where motions of objects do; the trajectories of the problem are of matter that stays
        where it begins until `gasp_core.reduction.leading.trajectories_of` has been asked.
    """

    problem: PointProblem
    spacing: float
    bodies: tuple[Body, ...]
    accuracy: EngineAccuracy
    colliders: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    pinned: tuple[str, ...] = ()
    leads: tuple[Lead, ...] = ()

    @property
    def body_names(self) -> list[str]:
        """Of the objects that the problem's bodies are, or are parts of."""
        own = [body.name for body in self.bodies]
        return [*own, *(own[host] for _, host in sorted(self.problem.rigid_parts.items()))]

    @property
    def drive_names(self) -> list[str]:
        """Of the problem's drives, for messages."""
        own = len(self.problem.drives) - len(self.pinned)
        return [*(f"drive {number}" for number in range(1, own + 1)), *self.pinned]


def assemble(
    scene: Scene,
    objects: Sequence[PlacedObject],
    motions: Mapping[str, Played] | None = None,
    known: Mapping[str, TransferOperator] | None = None,
    spacing: float | None = None,
) -> Assembly:
    """Build the problem of a scene whose objects have been placed.

    Parameters
    ----------
    scene, objects
        The objects in the order of the scene.
    motions
        Of those that move by themselves, by name.
    known
        What carried objects before, by name, and is to be taken again where it can be, see `sample_cores` and
        `sample_volume`.
    spacing
        Of the grid [m] before, where the scene leaves the resolution open: what was chosen once stays chosen.

    Raises
    ------
    SceneError
        Where nothing moves.
    """
    moving = [(index, placed) for index, placed in enumerate(objects) if placed.moving.any()]
    if not moving:
        raise SceneError("every object is static: nothing is left to simulate, leave static out of one of them")
    starts = np.cumsum([0, *(len(placed.gaussians) for placed in objects)])
    played = [(motions or {}).get(placed.item.name) for _, placed in moving]
    blocks = [
        block_of(
            placed.gaussians.select(placed.moving),
            motion.vertices if motion else placed.item.vertices or scene.maps.vertices,
        )
        for (_, placed), motion in zip(moving, played)
    ]
    choices = [chosen_mode(placed, (known or {}).get(placed.item.name)) for _, placed in moving]
    accuracy, notes = _accuracy(scene, [placed for _, placed in moving], blocks, choices, spacing)
    spacing = accuracy.spacing
    assert spacing is not None
    bodies: list[Body] = []
    columns: dict[str, list[Array]] = {}
    bounds: list[Array] = []
    sheets: list[BodyFaces] = []
    materials: dict[Material, int] = {}
    pins: dict[str, Drive] = {}
    leads: list[Lead] = []
    parts: dict[int, int] = {}
    start = 0
    for body, ((index, placed), block, motion, choice) in enumerate(zip(moving, blocks, played, choices)):
        drift = PrescribedMotion.of(motion, placed.moving, block.rest) if motion else None
        carried = drift is not None and drift.played.choice.composition == "carried"
        before = (known or {}).get(placed.item.name)
        floor = scene.maps.edge_floor * spacing
        reduction = reduction_of(placed, choice, block, floor, spacing)
        sample = _sample(placed, reduction, block, floor, spacing, carried, before)
        points, volumes = sample.positions + block.centre, sample.volumes
        matter = matter_of_points(placed, sample.carrier, points, volumes, spacing)
        rows = np.array([materials.setdefault(material, len(materials)) for material in matter.materials])
        pins |= matter.drives
        velocities = rigid_velocities(points, volumes, placed.item.velocity, placed.item.angular_velocity)
        if drift is not None:
            velocities = velocities + sample.carrier.gather(block.rest, drift.velocities())
        own = {
            "reference_positions": points,
            "initial_velocities": velocities,
            "reference_volumes": volumes,
            "material_ids": rows[matter.rows],
            "body_ids": np.full(len(points), body),
        }
        for group in range(1, int(matter.groups.max()) + 1):
            part = len(moving) + len(parts)
            own["body_ids"][matter.groups == group] = part
            parts[part] = body
        for name, column in own.items():
            columns.setdefault(name, []).append(column)
        gone = None
        if drift is not None and drift.played.choice.composition == "driven":
            gone, led = driven_gaussians(placed), np.flatnonzero(matter.driven)
            leads.append(Lead(motion=drift, carrier=sample.carrier, rest=block.rest, rows=led, first=start))
            drift = drift.select(gone)
        bodies.append(
            Body(
                name=placed.item.name,
                rows=starts[index] + np.flatnonzero(placed.moving),
                points=slice(start, start + len(points)),
                block=block,
                carrier=sample.carrier,
                notes=(
                    *_told(reduction, choice, sample),
                    *matter.notes,
                ),
                drift=drift if carried or gone is not None else None,
                driven=gone,
            )
        )
        bounds.append(sample.bounds + block.centre)
        if sample.faces is not None and not matter.groups.any():
            sheets.append(BodyFaces(body=body, faces=start + sample.faces))
        start += len(points)
    x, y, z = (np.min(bounds, axis=(0, 1)) + np.max(bounds, axis=(0, 1))) / 2
    joined: dict[str, Any] = {name: np.concatenate(column) for name, column in columns.items()}
    colliders = colliders_of(scene, objects)
    cloud = PointCloud(**joined)
    surfaces = rigid_surfaces([placed for _, placed in moving], parts, cloud.reference_positions, cloud.body_ids)
    names = [body.name for body in bodies]
    problem = PointProblem(
        points=cloud,
        materials=tuple(materials),
        body_contact=default_contact(scene.contacts),
        pair_contacts=pair_contacts(scene.contacts, [*names, *(names[host] for host in parts.values())]),
        rigid_parts=parts,
        colliders=tuple(colliders.values()),
        # Behind those of the scene: of two that hold one place the later wins, and what is pinned stands still.
        drives=(*scene.drives, *pins.values()),
        force_fields=scene.force_fields,
        gravity=scene.gravity,
        domain=scene.domain,
        trajectories=trajectories_at_rest(leads),
        hints=(GridAnchor(place=(float(x), float(y), float(z))), *surfaces, *sheets),
    )
    return Assembly(
        problem=problem,
        spacing=spacing,
        bodies=tuple(bodies),
        accuracy=accuracy,
        colliders=tuple(colliders),
        notes=notes,
        pinned=tuple(pins),
        leads=tuple(leads),
    )


def _sample(
    placed: PlacedObject,
    reduction: Reduction,
    block: Block,
    floor: float,
    spacing: float,
    drifts: bool,
    known: TransferOperator | None,
) -> Sample:
    """The points of an object by the mode it asks for, or that was chosen.

    Raises
    ------
    SceneError
        Where more cores are asked for than there are Gaussians.
    """
    if reduction.mode == "all":
        return sample_all(block, floor, spacing, drifts=drifts)
    if reduction.mode == "centres":
        return sample_centres(block, spacing)
    if reduction.mode == "mesh":
        return sample_mesh(
            block, mesh_at_start(placed), spacing, placed.item.name, known if isinstance(known, OnFaces) else None
        )
    if reduction.mode == "volume":
        frames = known if isinstance(known, PointFrames) else None
        return sample_volume(block, reduction, placed.solid(), placed.item.region, spacing, placed.item.name, frames)
    if reduction.count is not None and reduction.count > len(block.local):
        raise SceneError(
            f'object "{placed.item.name}": reduction.count {reduction.count} is more than the {len(block.local)}'
            ' Gaussians of it that move: ask for fewer, or for mode = "all"'
        )
    kinds = placed.part_numbers[placed.moving]
    before = known if isinstance(known, Levels | Attached) else None
    return sample_cores(block, reduction, floor, spacing, before, kinds)


def _told(reduction: Reduction, choice: Choice, sample: Sample) -> tuple[str, ...]:
    """The notes of a sample, the first one with the mode that was chosen, and why."""
    if not choice.why:
        return sample.notes
    first, *rest = sample.notes or ["every vertex is a point"]
    return (f'reduction "{reduction.mode}", because {choice.why}: {first}', *rest)


def _accuracy(
    scene: Scene,
    objects: Sequence[PlacedObject],
    blocks: Sequence[Block],
    choices: Sequence[Choice],
    known: float | None,
) -> tuple[EngineAccuracy, tuple[str, ...]]:
    """The engine's knobs, with a spacing [m], the `known` one if any, and a number of cells; how they came about."""
    sizes = [size_of(placed) for placed in objects]
    # A single Gaussian has no extent but its edges.
    sizes = [size or float(np.ptp(block.rest.reshape(-1, 3), axis=0).max()) for size, block in zip(sizes, blocks)]
    accuracy, notes = scene.accuracy, ()
    if accuracy.spacing is None and accuracy.resolution == "auto" and known is not None:
        accuracy, notes = replace(accuracy, spacing=known), (f"cells of {length_told(known)}, as it was recorded",)
    elif accuracy.spacing is None and accuracy.resolution == "auto":
        modes = {placed.item.name: choice.mode for placed, choice in zip(objects, choices)}
        resolution, why = chosen_resolution(objects, modes)
        accuracy, notes = replace(accuracy, resolution=resolution), (f"resolution {why}",)
    spacing = accuracy.spacing_for(max(sizes))
    if not _FINEST <= spacing <= _COARSEST:
        raise SceneError(
            f"a cell of this scene would be {spacing:.3g} m, which is no size of matter: look at height,"
            " metres_per_unit, and the spacing of [accuracy]"
        )
    if accuracy.resolution == "auto":
        accuracy = replace(accuracy, resolution=min(max(round(max(sizes) / spacing), 2), 4096))
    return replace(accuracy, spacing=spacing), notes

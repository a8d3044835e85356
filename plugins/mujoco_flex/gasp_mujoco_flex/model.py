# pyright: reportAttributeAccessIssue=false
# MuJoCo makes its names when it is imported; no stub lists them.
"""From cages, rigid bodies and colliders to MuJoCo's model of them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, ContactCondition, Elastic, PointProblem, Side
from gasp_core.errors import SceneError
from gasp_mujoco_flex.cage import Cage
from gasp_mujoco_flex.colliders import geoms_of, hull_geom
from gasp_mujoco_flex.elements import cell_stiffness, elasticity
from gasp_mujoco_flex.plugin import MujocoOptions
from gasp_mujoco_flex.rigid import RigidBody
from gasp_mujoco_flex.units import Units, units_of

__all__ = ["Model", "build_model"]

Array = NDArray[Any]

# Without one, MuJoCo writes a log into the working folder. What it warns of is read from its counters instead.
mujoco.set_mju_user_warning(lambda _: None)  # pyright: ignore[reportUnknownLambdaType]

_FIRM = (1e-9, 1.0)
"""MuJoCo raises the time constant of a contact to two steps: penetration is gone after some of them."""
_IMPEDANCE = (0.95, 0.99, 1e-3, 0.5, 2.0)
_RESTRAINED = (0.9999, 0.9999, 1e-3, 0.5, 2.0)
_ITERATIONS = 400
_TOUCHING = 1e-3
"""In cells: what begins deeper than this inside something would be thrown out of it."""
_LEAST_MASS = 1e-6
"""Of the mean: a node to which no point gives weight still has to have a mass."""
_FACTORED = 1500
"""Nodes up to which contacts are solved by Newton's method: it takes no longer than conjugate gradients (91 and 94 ms a
step of 1,000 nodes on a floor, 11 and 18 of 343; 560 and 240 of 2,197), and ends at rounding rather than at their last
iteration."""
_AXES = np.eye(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """MuJoCo's model, and where in its state what is.

    Nodes of all cages come first, three coordinates each; each rigid body has seven, and six velocities, behind them.

    Parameters
    ----------
    mj
        The compiled model.
    units
        What its numbers mean.
    cages, bodies
        In the order of the state.
    first_nodes
        Of each cage.
    gentle_geoms, gentle_flexes
        Shapes whose contacts stop matter and do not push it out, because some began inside.
    """

    mj: Any
    units: Units
    cages: tuple[Cage, ...]
    bodies: tuple[RigidBody, ...]
    first_nodes: tuple[int, ...]
    gentle_geoms: Array
    gentle_flexes: Array

    @property
    def nodes(self) -> int:
        """Of all cages."""
        return sum(len(cage.masses) for cage in self.cages)

    @property
    def factored(self) -> bool:
        """Whether contacts are solved by Newton's method."""
        return bool(self.mj.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON)

    @property
    def nodal_masses(self) -> Array:
        """Of the nodes of all cages, (M,), in `units`."""
        return self.mj.body_mass[1 : 1 + self.nodes]


def build_model(
    problem: PointProblem,
    cages: Sequence[Cage],
    bodies: Sequence[RigidBody],
    options: MujocoOptions,
) -> Model:
    """Compile a scene.

    Raises
    ------
    SceneError
        Where MuJoCo refuses it.
    """
    units = units_of(problem, cages, bodies)
    spec = mujoco.MjSpec()
    _set_options(spec, problem, units, sum(len(cage.masses) for cage in cages))
    crowded = _overlap(cages, bodies)
    friction = problem.body_contact.friction if options.body_friction is None else options.body_friction
    contact = {
        "condim": 3 if friction > 0 else 1,
        "friction": [friction, 0.0, 0.0],
        "solref": _FIRM,
        "solimp": _RESTRAINED if crowded else _IMPEDANCE,
    }
    gentle: list[bool] = []
    for collider in problem.colliders:
        if collider.contact is ContactCondition.SEPARATE:
            gentle += _add_collider(spec, collider, units, cages, bodies)
    for number, cage in enumerate(cages):
        _add_cage(spec, f"cage{number}", cage, problem, units, options, contact)
    for number, body in enumerate(bodies):
        gentle += _add_rigid(spec, f"body{number}", body, units, contact, crowded)
    with warnings.catch_warnings():
        # A cage touches by a flex of its own that has no stiffness, which MuJoCo wonders about.
        warnings.simplefilter("ignore")
        try:
            compiled = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise SceneError(f"mujoco-flex: MuJoCo refuses the scene: {' '.join(str(error).split())}") from error
    if options.elements == "hexahedra":
        _set_stiffness(compiled, cages, problem, units)
    # Not as damping of joints, which the compiler takes from no node of a flex.
    rates = [_mass_damping(cage, problem) * units.time for cage in cages]
    nodes = sum(map(len, rates))
    compiled.dof_damping[: 3 * nodes] = np.repeat(np.concatenate([*rates, []]) * compiled.body_mass[1 : 1 + nodes], 3)
    counts = [len(cage.masses) for cage in cages]
    return Model(
        mj=compiled,
        units=units,
        cages=tuple(cages),
        bodies=tuple(bodies),
        first_nodes=tuple(int(first) for first in np.cumsum([0, *counts])[:-1]),
        gentle_geoms=np.array(gentle, dtype=bool),
        gentle_flexes=np.full(compiled.nflex, crowded),
    )


def _set_options(spec: Any, problem: PointProblem, units: Units, nodes: int) -> None:
    option = spec.option
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON if nodes <= _FACTORED else mujoco.mjtSolver.mjSOL_CG
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.iterations = _ITERATIONS
    option.gravity = np.asarray(problem.gravity) / units.acceleration
    # What is not finite has to be seen, not set back to the start.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def _add_collider(
    spec: Any, collider: Collider, units: Units, cages: Sequence[Cage], bodies: Sequence[RigidBody]
) -> list[bool]:
    sign = 1.0 if collider.side is Side.OUTSIDE else -1.0
    depth = 0.0
    for places, side in [
        *((cage.positions, cage.grid.sides.max()) for cage in cages),
        *((body.centre + body.corners, np.cbrt(body.matter.volumes.sum())) for body in bodies),
    ]:
        depth = max(depth, float((-sign * collider.shape.signed_distance(places)).max()) / side)
    gentle = depth > _TOUCHING
    added = 0
    for shape in geoms_of(spec, collider, units):
        spec.worldbody.add_geom(
            **shape,
            # The collider's own friction counts, whatever the body's is.
            priority=1,
            condim=3 if collider.friction > 0 else 1,
            friction=[collider.friction, 0.0, 0.0],
            solref=_FIRM,
            solimp=_RESTRAINED if gentle else _IMPEDANCE,
        )
        added += 1
    return [gentle] * added


def _add_cage(
    spec: Any,
    name: str,
    cage: Cage,
    problem: PointProblem,
    units: Units,
    options: MujocoOptions,
    contact: dict[str, Any],
) -> None:
    names: list[str] = []
    masses = np.maximum(cage.masses, _LEAST_MASS * cage.masses.mean()) / units.mass
    places = units.place(cage.positions)
    for number, (place, mass) in enumerate(zip(places, masses)):
        # It does not turn: any inertia will do.
        node = spec.worldbody.add_body(
            name=f"{name}_{number}", pos=place, mass=mass, inertia=[mass] * 3, explicitinertial=True
        )
        for axis in _AXES:
            node.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        names.append(node.name)
    touching = _add_flex(spec, f"{name}_skin", cage.tetrahedra, names, **contact)
    if options.self_collision:
        touching.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_AUTO
    untouchable = {"contype": 0, "conaffinity": 0}
    if options.elements == "tetrahedra":
        cell_materials = np.repeat(cage.materials, 6)
        for material in np.unique(cage.materials):
            modulus = _solid(problem, material).youngs_modulus * units.length**2 / units.force
            fraction = float(cage.fractions[cage.materials == material].mean())
            tetrahedra = cage.tetrahedra[cell_materials == material]
            flex = _add_flex(spec, f"{name}_elastic{material}", tetrahedra, names, **untouchable)
            flex.young, flex.poisson = modulus * fraction, _solid(problem, material).poissons_ratio
            flex.elastic3d = 1
            flex.damping = (options.damping + _solid(problem, material).stiffness_damping) / units.time
        return
    # Any stiffness: `_set_stiffness` replaces it cell by cell.
    flex = spec.add_flex(name=f"{name}_elastic", dim=3, radius=0, **untouchable)
    flex.young, flex.poisson = 1.0, 0.0
    flex.damping = (options.damping + _common_stiffness_damping(cage, problem)) / units.time
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.order, flex.cellcount = 1, list(cage.grid.shape)
    full = tuple(side + 1 for side in cage.grid.shape)
    at = np.full(full, -1)
    at[tuple(cage.nodes.T)] = np.arange(len(names))
    grid_nodes = units.place(cage.grid.lower + np.argwhere(at > -2) * cage.grid.sides)
    flex.nodebody = [names[node] if node >= 0 else "world" for node in at.ravel()]
    flex.node = np.where((at.ravel() >= 0)[:, None], 0.0, grid_nodes).ravel()
    flex.vertbody = ["world"] * len(names)
    flex.vert = places.ravel()
    flex.elem = cage.tetrahedra.ravel()


def _add_flex(spec: Any, name: str, tetrahedra: Array, names: Sequence[str], **keywords: Any) -> Any:
    flex = spec.add_flex(name=name, dim=3, radius=0, **keywords)
    used, elements = np.unique(tetrahedra, return_inverse=True)
    flex.vertbody = [names[node] for node in used]
    flex.elem = elements.ravel()
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    return flex


def _solid(problem: PointProblem, material: int) -> Elastic:
    found = problem.materials[material]
    assert isinstance(found, Elastic), found
    return found


def _mass_damping(cage: Cage, problem: PointProblem) -> Array:
    """Of every node (M,) [1/s]: of the matter that it stands for, by mass."""
    rates = np.array([getattr(material, "mass_damping", 0.0) for material in problem.materials])
    matter = cage.matter
    lost = np.asarray(cage.embedding.weights().T @ (matter.masses * rates[matter.materials]))
    return lost / np.where(cage.masses > 0, cage.masses, 1.0)


def _common_stiffness_damping(cage: Cage, problem: PointProblem) -> float:
    """[s]: MuJoCo has one number for all cells that bend."""
    found = {_solid(problem, material).stiffness_damping for material in np.unique(cage.materials)}
    if len(found) > 1:
        low, high = min(found), max(found)
        raise SceneError(
            f"mujoco-flex: materials of one body differ in stiffness_damping ({low:g} and {high:g} s), and cells that"
            ' bend have one for all: say one number, or elements = "tetrahedra"'
        )
    return found.pop()


def _set_stiffness(compiled: Any, cages: Sequence[Cage], problem: PointProblem, units: Units) -> None:
    """Give every cell its own stiffness: of its material, and as much of it as the cell is filled."""
    for number, cage in enumerate(cages):
        start = int(
            compiled.flex_stiffnessadr[mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_FLEX, f"cage{number}_elastic")]
        )
        size = 576 * int(np.prod(cage.grid.shape))
        cells = compiled.flex_stiffness[start : start + size].reshape(*cage.grid.shape, 576)
        of_material = {
            material: cell_stiffness(
                cage.grid.sides,
                elasticity(_solid(problem, material).youngs_modulus, _solid(problem, material).poissons_ratio),
            )
            for material in np.unique(cage.materials)
        }
        cells[:] = 0.0
        for cell, fraction, material in zip(cage.voxels, cage.fractions, cage.materials):
            # Forces, so with the other sign.
            cells[tuple(cell)] = -of_material[material].ravel() * fraction * units.length / units.force


def _add_rigid(
    spec: Any, name: str, body: RigidBody, units: Units, contact: dict[str, Any], crowded: bool
) -> list[bool]:
    inertia = body.inertia / (units.mass * units.length**2)
    xx, yy, zz, xy, xz, yz = (inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    free = spec.worldbody.add_body(
        name=name,
        pos=units.place(body.centre),
        mass=body.matter.mass / units.mass,
        ipos=[0.0, 0.0, 0.0],
        fullinertia=[xx, yy, zz, xy, xz, yz],
        explicitinertial=True,
    )
    free.add_freejoint()
    for hull in body.hulls:
        free.add_geom(**hull_geom(spec, hull / units.length), **contact)
    for middle, half in body.boxes / units.length:
        free.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=middle, size=half, **contact)
    return [crowded] * (len(body.hulls) + len(body.boxes))


def _overlap(cages: Sequence[Cage], bodies: Sequence[RigidBody]) -> bool:
    """Whether any two bodies begin inside each other, by the boxes around them."""
    boxes = [(cage.grid.lower, cage.grid.sides * cage.grid.shape) for cage in cages]
    boxes += [(body.centre + low, high - low) for body in bodies for low, high in [_bounds(body.corners)]]
    for number, (lower, extent) in enumerate(boxes):
        for other, wide in boxes[:number]:
            common = np.minimum(lower + extent, other + wide) - np.maximum(lower, other)
            if (common > _TOUCHING * np.minimum(extent, wide)).all():
                return True
    return False


def _bounds(places: Array) -> tuple[Array, Array]:
    return places.min(axis=0), places.max(axis=0)

"""A scene of Genesis: made once for a kind of problem, filled and stepped as often as one likes.

Everything goes through Genesis' public methods but the masses, which have none: they are written into the public field
`particles_info.mass` of its solver. `Nowhere`, which makes room for points without placing any, is documented as
internal; it is the one shape that asks for no sampling.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import genesis  # pyright: ignore[reportMissingImports]
import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from gasp_genesis_mpm import added_materials
from gasp_genesis_mpm.colliders import WallKind
from gasp_genesis_mpm.material_mapping import Law
from gasp_genesis_mpm.particle_state import TICK, Numbers

__all__ = ["Blueprint", "Stage"]

Array = NDArray[Any]

_BOX_CELLS = 96
"""Of the distance field of a box, along its longest side: Genesis knows no box in closed form."""
_SKIN = 1e-3
"""Of walls [cells]. Without one, a face that lies on a layer of nodes holds what the rounding of the nodes' distances
decides, down to nothing: a slab of two cells let matter fall through."""


@dataclass(frozen=True, slots=True)
class Blueprint:
    """What Genesis compiles into its kernels; scenes of one blueprint are one scene.

    Parameters
    ----------
    half
        Half the grid's sides [cells].
    counts
        Of points, by portion.
    laws
        By portion.
    walls
        What matter collides with.
    """

    half: tuple[int, int, int]
    counts: tuple[int, ...]
    laws: tuple[Law, ...]
    walls: tuple[WallKind, ...]


class Stage:
    """A scene of Genesis, in its numbers (`gasp_genesis_mpm.particle_state`)."""

    def __init__(self, blueprint: Blueprint) -> None:
        options = genesis.options
        self._scene = genesis.Scene(
            sim_options=options.SimOptions(dt=TICK, substeps=1, gravity=(0.0, 0.0, 0.0)),
            mpm_options=options.MPMOptions(
                grid_density=1.0,
                particle_size=1.0,
                lower_bound=tuple(-float(side) for side in blueprint.half),
                upper_bound=tuple(float(side) for side in blueprint.half),
            ),
            # Its bodies are walls: they do not move, and need not know of each other.
            rigid_options=options.RigidOptions(enable_collision=False, disable_constraint=True),
            show_viewer=False,
        )
        for count, law in zip(blueprint.counts, blueprint.laws):
            kind = getattr(added_materials, law.name, None) or getattr(genesis.materials.MPM, law.name)
            self._scene.add_entity(
                morph=genesis.morphs.Nowhere(n_particles=count),
                material=kind(rho=1.0, **dict(law.parameters)),
                surface=genesis.surfaces.Default(vis_mode="particle"),
            )
        self._walls = [self._wall(kind) for kind in blueprint.walls]
        self._scene.build()
        self._solver = self._scene.mpm_solver
        self._rehearse(sum(blueprint.counts))

    def _rehearse(self, count: int) -> None:
        """Have everything compiled that a substep takes: it belongs to opening a scene, not to its first frame."""
        nothing = np.zeros((count, 3))
        at_rest = Numbers(
            positions=nothing,
            velocities=nothing,
            affine_velocities=np.zeros((count, 3, 3)),
            deformations=np.tile(np.eye(3), (count, 1, 1)),
            history=np.ones(count),
        )
        self.write(at_rest, np.ones(count), np.zeros(count), (0.0, 0.0, 0.0), np.zeros((len(self._walls), 3)))
        self.step(1)
        self.read()

    def _wall(self, kind: WallKind) -> Any:
        rigid = genesis.materials.Rigid(
            needs_coup=True,
            coup_friction=kind.friction,
            coup_softness=_SKIN,
            coup_restitution=0.0,
            sdf_cell_size=max(kind.size) / _BOX_CELLS or 1.0,
            sdf_max_res=_BOX_CELLS + 32,
        )
        if kind.normal is None:
            morph = genesis.morphs.Box(size=kind.size, fixed=True, visualization=False)
        else:
            morph = genesis.morphs.Plane(normal=kind.normal, visualization=False)
        return self._scene.add_entity(morph=morph, material=rigid)

    def write(
        self,
        numbers: Numbers,
        masses: Array,
        actuations: Array,
        gravity: tuple[float, float, float],
        walls: Array,
    ) -> None:
        """Set everything that is not compiled.

        Parameters
        ----------
        numbers
            The points.
        masses, actuations : (N,)
        gravity
        walls : (W, 3)
            Their places.
        """
        state = self._solver.get_state(0)
        for target, source in (
            (state.pos, numbers.positions),
            (state.vel, numbers.velocities),
            (state.C, numbers.affine_velocities),
            (state.F, numbers.deformations),
            (state.Jp, numbers.history),
            (state.actu, actuations),
        ):
            target[0] = torch.from_numpy(np.ascontiguousarray(source))
        state.active[:] = True
        self._solver.set_state(0, state)
        mass = self._solver.particles_info.mass
        mass.from_numpy(masses.astype(genesis.np_float))
        self._solver.set_gravity(gravity)
        for wall, place in zip(self._walls, walls):
            wall.set_pos(tuple(float(component) for component in place))

    def step(self, count: int) -> None:
        """Take `count` substeps.

        Raises
        ------
        FloatingPointError
            Where Genesis finds a position that is no number.
        """
        try:
            for _ in range(count):
                self._scene.step(update_visualizer=False)
        except genesis.GenesisException as error:
            raise FloatingPointError(" ".join(str(error).split())) from error

    def read(self) -> Numbers:
        """The points."""
        state = self._solver.get_state(0)
        positions, velocities, affine, deformations, history = (
            tensor[0].detach().cpu().numpy().astype(np.float64)
            for tensor in (state.pos, state.vel, state.C, state.F, state.Jp)
        )
        return Numbers(
            positions=positions,
            velocities=velocities,
            affine_velocities=affine,
            deformations=deformations,
            history=history,
        )

    def destroy(self) -> None:
        """Give back what Genesis gives back."""
        self._scene.destroy()

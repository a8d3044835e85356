"""Problems of rigid bodies for the tests beside."""

from __future__ import annotations

import numpy as np

from gasp_core.contract import BodyContact, Collider, HalfSpace, PointCloud, PointProblem, Rigid

FLOOR = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)), friction=0.5)


def block(cells, spacing, center=(0.0, 0.0, 0.0)):
    """Centres (N, 3) [m] of cubes that fill a block of so many along each axis."""
    axes = [(np.arange(count) - (count - 1) / 2) * spacing for count in cells]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + np.asarray(center)


def problem_of(parts, spacing, velocities=None, materials=None, **rest):
    """A problem of one body a part, each with its velocity; all of one rigid material where none is given."""
    materials = materials or [Rigid(density=500.0)] * len(parts)
    points = np.concatenate(parts)
    ids = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    velocities = velocities or [np.zeros(3)] * len(parts)
    start = np.concatenate([np.broadcast_to(one, part.shape) for one, part in zip(velocities, parts)])
    tracers = rest.pop("tracers", None)
    contact = rest.pop("body_contact", BodyContact(friction=0.5))
    cloud = PointCloud(
        reference_positions=points,
        initial_velocities=start,
        reference_volumes=np.full(len(points), spacing**3),
        material_ids=ids,
        body_ids=ids,
        tracer_positions=tracers,
    )
    return PointProblem(points=cloud, materials=tuple(materials), body_contact=contact, **rest)

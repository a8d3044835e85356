"""The cylinder that rolls."""

import numpy as np
from gasp_conformance.rigid_cases import _Cylinder


def test_its_normal_is_the_gradient_of_its_distance() -> None:
    """Near its side and near its ends; on the edge between them neither is right."""
    cylinder = _Cylinder(center=(0.1, 0.2, 0.3), radius=0.5, half_length=0.7)
    arms = np.random.default_rng(0).uniform(-0.9, 0.9, (2000, 3))
    places = arms + [0.1, 0.2, 0.3]
    radial, axial = np.hypot(arms[:, 0], arms[:, 2]) - 0.5, np.abs(arms[:, 1]) - 0.7
    # Outside of both the nearest place is on the edge.
    places = places[(np.abs(radial - axial) > 1e-3) & (np.minimum(radial, axial) < 0)]
    step = 1e-6
    slopes = [
        cylinder.signed_distance(places + step * e) - cylinder.signed_distance(places - step * e) for e in np.eye(3)
    ]
    np.testing.assert_allclose(cylinder.outward_normal(places), np.stack(slopes, axis=1) / (2 * step), atol=1e-3)

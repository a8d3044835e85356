"""How well T^-1 gives back F Sigma F^T: the exact inverse and the paper's, 1,000 random affine motions.

python benchmarks/inverse_accuracy.py
"""

import numpy as np

from gasp_core import games
from gasp_core.gaussians import Gaussians, rotation_matrices

MOTIONS, COUNT = 1000, 100


def random_affine(rng):
    """Shear to 3 and stretches .1 to 10 between two random rotations."""
    turn, back = (rotation_matrices(rng.normal(size=(1, 4)))[0] for _ in range(2))
    shear = np.eye(3) + np.triu(rng.uniform(-3, 3, (3, 3)), 1)
    return turn @ np.diag(10 ** rng.uniform(-1, 1, 3)) @ shear @ back


def main():
    rng = np.random.default_rng(0)
    print(f"{MOTIONS} affine motions of {COUNT} Gaussians: |Sigma - F Sigma_0 F^T| / |F Sigma_0 F^T|")
    print(f"{'Gaussians':<12} {'vertices':>8} {'inverse':<14} {'median':>10} {'99 %':>10} {'largest':>10}")
    for kind, vertices in (("flat", 3), ("full", 4)):
        scales = 10 ** rng.uniform(-2, 0, (COUNT, 3))
        if kind == "flat":
            scales[:, 0] = 0
        gaussians = Gaussians(
            means=rng.uniform(-1, 1, (COUNT, 3)),
            quaternions=rng.normal(size=(COUNT, 4)),
            scales=scales,
            opacities=np.ones(COUNT),
            harmonics=np.zeros((COUNT, 1, 3)),
        )
        simplices, covariances = games.to_simplices(gaussians, vertices), gaussians.covariances()
        for inverse in ("exact", "gram_schmidt"):
            errors = []
            for _ in range(MOTIONS):
                affine = random_affine(rng)
                wanted = affine @ covariances @ affine.T
                moved = games.from_simplices(simplices @ affine.T, reference=gaussians, covariance=inverse)
                difference = np.linalg.norm(moved.covariances() - wanted, axis=(1, 2))
                errors.append(difference / np.linalg.norm(wanted, axis=(1, 2)))
            median, high, largest = np.percentile(np.concatenate(errors), [50, 99, 100])
            print(f"{kind:<12} {vertices:>8} {inverse:<14} {median:>10.1e} {high:>10.1e} {largest:>10.1e}")


if __name__ == "__main__":
    main()

"""Where one sees a splat: on lines from many sides, where half of the light is used up."""

import itertools

import numpy as np

SIDES = [side for side in itertools.product((-1, 0, 1), repeat=3) if any(side) and side[2] >= 0]
"""From a floor nobody looks up."""


def places_seen(gaussians, count, seed=0):
    """Places (P, 3), at most `count` for each of the sides, on as many lines through the box of most centres.

    As renderers draw them: each Gaussian one opacity on a line, that of its picture there, nearer centres first; the
    place is the densest on the line of the one that takes the light below a half (median depth).
    """
    rng = np.random.default_rng(seed)
    means, opacities = gaussians.means.astype(np.float64), gaussians.opacities.astype(np.float64)
    flattest = 1e-4 * np.ptp(means, axis=0).max()
    covariances = gaussians.covariances().astype(np.float64) + flattest**2 * np.eye(3)
    found = []
    for side in SIDES:
        towards = np.array(side) / np.linalg.norm(side)
        right = np.cross(towards, np.roll(np.eye(3)[np.argmax(np.abs(towards))], 1))
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(towards, right), -towards])
        places = means @ frame.T
        spread = frame @ covariances @ frame.T
        order = np.argsort(places[:, 2])
        inverses = np.linalg.inv(spread[:, :2, :2])
        reach = 3 * np.sqrt(np.einsum("naa->na", spread[:, :2, :2]))
        lower, upper = np.percentile(places[:, :2], [0.5, 99.5], axis=0)
        for target in rng.uniform(lower, upper, (count, 2)):
            way = target - places[:, :2]
            near = order[(np.abs(way[order]) < reach[order]).all(axis=1)]
            square = np.einsum("na,nab,nb->n", way[near], inverses[near], way[near])
            alphas = np.where(square < 9, opacities[near] * np.exp(-0.5 * square), 0.0)
            left = np.cumprod(1 - alphas)
            if len(left) and left[-1] < 0.5:
                row = near[np.argmax(left < 0.5)]
                deeper = spread[row, 2, :2] @ inverses[row] @ way[row]
                found.append([*target, places[row, 2] + deeper] @ frame)
    return np.array(found)

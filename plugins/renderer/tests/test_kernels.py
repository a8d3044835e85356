import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from gasp_renderer import binning, blending, projection, sorting
from gasp_renderer.rasteriser import tile_lists
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

KERNELS = (projection.project, sorting.front_to_back, binning.count_pairs, binning.list_pairs, blending.blend)


def test_exp2_is_as_exact_as_it_says():
    exponents = np.linspace(-8, 0, 100_001, dtype=np.float32)
    found = np.array([blending.exp2(x) for x in exponents[::20]], dtype=np.float64)
    # 2.6e-6 of the polynomial, six roundings of 2^-24, and the exponent's own of 2^-22 after the shift by 8.
    bound = 2.6e-6 + 6 * 2**-24 + 2**-22
    assert np.abs(found / 2.0 ** exponents[::20].astype(np.float64) - 1).max() <= bound


@given(
    hnp.arrays(
        np.float64,
        st.integers(0, 300),
        elements=st.one_of(st.floats(1e-3, 1.0), st.sampled_from([0.5, 1.0, np.inf]), st.floats(0.5, 0.5 + 1e-9)),
    )
)
def test_depths_are_sorted_stably_to_2_to_the_minus_40(depths):
    order = sorting.front_to_back(depths)
    assert sorted(order) == np.flatnonzero(np.isfinite(depths)).tolist()
    ordered = depths[order]
    # 44 bits for three decades, ten octaves: 4 bits of those count octaves, 40 halve within them.
    assert (ordered[1:] >= ordered[:-1] * (1 - 2.0**-40)).all()
    equal = ordered[1:] == ordered[:-1]
    assert (order[1:][equal] > order[:-1][equal]).all()


def test_depths_over_all_of_float64_are_sorted():
    depths = 10.0 ** np.random.default_rng(0).uniform(-300, 300, 5000)
    assert (np.diff(depths[sorting.front_to_back(depths)]) > 0).all()


@pytest.mark.parametrize("threads", [1, 2])
def test_every_tile_lists_the_gaussians_whose_box_holds_it(threads, front):
    if threads > numba.config.NUMBA_NUM_THREADS:
        pytest.skip("one processor")
    rng = np.random.default_rng(0)
    camera = front(100, 70)
    boxes = np.sort(np.stack([rng.integers(0, 8, (50, 2)), rng.integers(0, 6, (50, 2))], axis=1), axis=2)
    boxes = boxes.reshape(50, 4).astype(np.int16)
    order = rng.permutation(50).astype(np.int32)[:40]
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        starts, lists = tile_lists(order, boxes, camera)
    finally:
        numba.set_num_threads(before)
    for tile in range(7 * 5):
        row, column = divmod(tile, 7)
        b = boxes[order]
        inside = (b[:, 0] <= column) & (column < b[:, 1]) & (b[:, 2] <= row) & (row < b[:, 3])
        assert lists[starts[tile] : starts[tile + 1]].tolist() == order[inside].tolist()


DRAW = """
import hashlib
import numpy as np
from gasp_core.rendering.camera import look_at
from gasp_core.render_input import RenderInput
from gasp_renderer import binning, blending, projection, sorting
from gasp_renderer.rasteriser import NumbaRenderer
rng = np.random.default_rng(0)
splats = RenderInput(
    means=rng.normal(size=(3000, 3)), opacities=rng.random(3000), harmonics=rng.normal(size=(3000, 4, 3)),
    quaternions=rng.normal(size=(3000, 4)), scales=10 ** rng.uniform(-3, -1, size=(3000, 3)),
)
camera = look_at((0, -6, 1), (0, 0, 0), width=203, height=150)
picture = NumbaRenderer().render(splats, camera)
kernels = (projection.project, sorting.front_to_back, binning.count_pairs, binning.list_pairs, blending.blend)
print(hashlib.sha256(picture.colour.tobytes() + picture.alpha.tobytes() + picture.depth.tobytes()).hexdigest())
print([sum(kernel.stats.cache_hits.values()) for kernel in kernels])
print([sum(kernel.stats.cache_misses.values()) for kernel in kernels])
"""


def test_a_second_process_compiles_nothing_and_threads_change_no_bit(fast, cloud, front):
    fast.render(cloud(), front())  # compiles, where nothing has yet
    pictures = set()
    for threads in ("1", "2", "5"):
        child = subprocess.run(
            [sys.executable, "-c", DRAW],
            env=os.environ | {"NUMBA_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        )
        picture, hits, misses = child.stdout.split("\n")[:3]
        assert (hits, misses) == ("[1, 1, 1, 1, 1]", "[0, 0, 0, 0, 0]"), child.stdout
        pictures.add(picture)
    assert len(pictures) == 1


def test_each_kernel_is_compiled_once_whatever_it_is_given(fast, cloud, front):
    base = cloud(30, degree=1)
    frozen = base.means.copy()
    frozen.flags.writeable = False
    buffer = bytearray(30 * 12 + 1)
    unaligned = np.frombuffer(buffer, np.float32, 90, offset=1).reshape(30, 3)
    variants = [
        {},
        {"means": frozen},
        {"means": base.means.astype(np.float64)},
        {"means": base.means.astype(">f4")},
        {"means": unaligned + 0.0, "scales": unaligned},
        {"scales": np.asfortranarray(base.scales)},
        {"harmonics": base.harmonics.astype(np.float64)[:, ::-1]},
        {"opacities": np.ones(30, int), "turns": np.broadcast_to(np.eye(3), (30, 3, 3))},
        {"quaternions": None, "scales": None, "covariances": np.ones((30, 6), np.float32)},
    ]
    for changes in variants:
        arrays = {name: getattr(base, name) for name in type(base).__dataclass_fields__} | changes
        fast.render(type(base)(**arrays), front())
        fast.render(type(base)(**arrays), front(33, 20), occluders=np.full((20, 33), 5.0))
    assert [len(kernel.signatures) for kernel in KERNELS] == [1] * len(KERNELS)

"""Which tracers wake, and what is active with them, against the obvious."""

import numpy as np
import pytest
from gasp_mpm_host.cells import BLOCK, arrange
from gasp_mpm_host.tracers import TRACER_MARGIN, TracerRows, arrange_tracers, homes_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gasp_core.errors import SceneError

HOMES = arrays(np.int32, st.tuples(st.integers(1, 20), st.just(3)), elements=st.integers(-20, 20))
TRACERS = arrays(np.int32, st.tuples(st.integers(0, 40), st.just(3)), elements=st.integers(-40, 40))
REACH = np.stack(np.meshgrid(*[np.arange(-1, 4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def nodes_near(home):
    return home[:, None, :] + REACH


@given(HOMES, TRACERS)
def test_whoever_can_meet_mass_is_awake_and_has_all_its_nodes_cleared(home, tracers):
    tables, _ = arrange(home, 2**28, TRACER_MARGIN)
    found = arrange_tracers(tracers, tables, np.ones(len(tracers), dtype=bool))
    assert np.array_equal(np.sort(found.order), np.arange(len(tracers)))
    massive = {tuple(node) for node in nodes_near(home).reshape(-1, 3)}
    awake = set(found.order[: found.awake].tolist())
    blocks = tables.shape // BLOCK
    active = set(found.active.tolist())
    assert set(tables.active.tolist()) <= active
    for index, nodes in enumerate(nodes_near(tracers)):
        if massive & {tuple(node) for node in nodes}:
            assert index in awake
        if index in awake:
            local = nodes - tables.lower
            assert (local >= 0).all()
            assert (local < tables.shape).all()
            assert set(np.ravel_multi_index((local // BLOCK).T, blocks)) <= active


@given(HOMES, TRACERS)
def test_the_awake_are_sorted_by_block_and_cell(home, tracers):
    tables, _ = arrange(home, 2**28, TRACER_MARGIN)
    found = arrange_tracers(tracers, tables, np.ones(len(tracers), dtype=bool))
    awake = tracers[found.order[: found.awake]] - tables.lower
    expected = np.lexsort((*(awake % BLOCK).T[::-1], *(awake // BLOCK).T[::-1]))
    assert np.array_equal(expected, np.arange(found.awake))
    # Sorted once, they stay: a restart puts its rows through the same tables.
    again = arrange_tracers(tracers[found.order], tables, np.ones(len(tracers), dtype=bool))
    assert np.array_equal(again.order, np.arange(len(tracers)))


def test_a_tracer_beyond_all_numbers_rests():
    tables, _ = arrange(np.zeros((1, 3), dtype=np.int32), 2**28, TRACER_MARGIN)
    homes = homes_of(np.array([[1e300, 0, 0], [0.9, 0.9, 0.9], [-1e12, 3, 3]]))
    found = arrange_tracers(homes, tables, np.ones(3, dtype=bool))
    assert found.awake == 1
    assert found.order.tolist() == [1, 0, 2]


def test_a_checkpoint_with_other_tracers_is_refused():
    kept = TracerRows(cells=np.ones((3, 3)), homes=np.zeros((3, 3), np.int32), ids=np.arange(3, dtype=np.int32))
    assert np.array_equal(TracerRows.restored(kept.checkpoint(), 3, "an engine").cells, kept.cells)
    with pytest.raises(SceneError, match=r"an engine.*tracer_cells, expected \(4, 3\)"):
        TracerRows.restored(kept.checkpoint(), 4, "an engine")
    with pytest.raises(SceneError, match="holds nothing for tracer_cells"):
        TracerRows.restored({}, 1, "an engine")


def test_a_tracer_among_matter_of_another_body_rests():
    tables, _ = arrange(np.zeros((1, 3), dtype=np.int32), 2**28, TRACER_MARGIN)
    homes = np.zeros((2, 3), dtype=np.int32)
    found = arrange_tracers(homes, tables, np.array([False, True]))
    assert found.awake == 1
    assert found.order.tolist() == [1, 0]

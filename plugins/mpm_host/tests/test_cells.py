"""Sorting and colouring, against the obvious."""

import numpy as np
import pytest
from gasp_mpm_host.cells import BLOCK, COLOURS, GridTooLargeError, arrange, cell_keys
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

HOMES = arrays(np.int32, st.tuples(st.integers(1, 60), st.just(3)), elements=st.integers(-40, 40))


@given(HOMES)
def test_order_is_a_stable_sort_by_block_and_cell(home):
    tables, order = arrange(home, 2**28)
    local = home - tables.lower
    block, inside = local // BLOCK, local % BLOCK
    expected = np.lexsort((np.arange(len(home)), *inside.T[::-1], *block.T[::-1]))
    assert np.array_equal(order, expected)


@given(HOMES)
def test_tiles_hold_every_point_once_and_one_block_each(home):
    tables, order = arrange(home, 2**28)
    rows = np.concatenate([np.arange(begin, end) for begin, end in tables.tiles])
    assert np.array_equal(np.sort(rows), np.arange(len(home)))
    for begin, end in tables.tiles:
        assert len(np.unique(home[order[begin:end]] // BLOCK, axis=0)) == 1
    assert tables.colour_offsets[0] == 0
    assert tables.colour_offsets[-1] == len(tables.tiles)


@given(HOMES)
def test_tiles_of_a_colour_write_disjoint_nodes_even_after_drift(home):
    """A point may be one cell away from home, and its stencil has 3 nodes: it writes home - 1 .. home + 3."""
    tables, order = arrange(home, 2**28)
    for colour in range(COLOURS):
        written = set()
        for begin, _ in tables.tiles[tables.colour_offsets[colour] : tables.colour_offsets[colour + 1]]:
            corner = home[order[begin]] // BLOCK * BLOCK
            span = [range(corner[axis] - 1, corner[axis] + BLOCK + 3) for axis in range(3)]
            nodes = {(x, y, z) for x in span[0] for y in span[1] for z in span[2]}
            assert not nodes & written
            written |= nodes


@given(HOMES)
def test_every_node_within_reach_is_active_and_on_the_grid(home):
    tables, _ = arrange(home, 2**28)
    offsets = np.stack(np.meshgrid(*[np.arange(-1, 4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    nodes = (home[:, None, :] + offsets - tables.lower).reshape(-1, 3)
    assert (nodes >= 0).all()
    assert (nodes < tables.shape).all()
    blocks = tables.shape // BLOCK
    assert set(np.ravel_multi_index((nodes // BLOCK).T, blocks)) == set(tables.active.tolist())


@given(HOMES)
def test_cells_and_their_counts_say_where_every_point_is(home):
    tables, order = arrange(home, 2**28)
    found, counts = np.unique(cell_keys(home, tables.lower, tables.shape // BLOCK), return_counts=True)
    assert np.array_equal(tables.cells, found)
    assert np.array_equal(tables.counts, counts)
    keys = cell_keys(home[order], tables.lower, tables.shape // BLOCK)
    assert np.array_equal(np.repeat(tables.cells, tables.counts), keys)


def test_more_than_65536_cells_are_sorted_too():
    home = np.random.default_rng(0).integers(-300, 300, size=(2000, 3)).astype(np.int32)
    _, order = arrange(home, 2**28)
    assert np.array_equal(np.sort(order), np.arange(2000))
    blocks = home[order] // BLOCK
    change = (np.diff(blocks, axis=0) != 0).any(axis=1).sum() + 1
    assert change == len(np.unique(blocks, axis=0))


def test_a_grid_beyond_the_limit_is_refused():
    with pytest.raises(GridTooLargeError):
        arrange(np.array([[0, 0, 0], [2000, 2000, 2000]], dtype=np.int32), 2**28)


@given(HOMES, st.integers(0, 2))
def test_a_margin_is_around_the_grid_and_changes_no_order(home, margin):
    (plain, order), (wide, again) = arrange(home, 2**28), arrange(home, 2**28, margin)
    assert np.array_equal(wide.lower, plain.lower - margin * BLOCK)
    assert np.array_equal(wide.shape, plain.shape + 2 * margin * BLOCK)
    assert np.array_equal(again, order)
    assert np.array_equal(wide.tiles, plain.tiles)

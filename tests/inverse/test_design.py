"""The grid: the paper's nodes, and moves that keep the simulations already run."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.inverse.design import Design

PAPER = Design((71.0, 1.14e-4))


def test_the_papers_grid():
    assert PAPER.f_max.tolist() == pytest.approx([56.8, 63.9, 71.0, 78.1, 85.2], rel=1e-14)  # Fig. 8, round-off
    assert PAPER.shape == (5, 5)
    assert PAPER.nodes()[1] == (PAPER.f_max[0], PAPER.delta_max[1])
    assert len(set(PAPER.nodes())) == 25


@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), max_size=4))
def test_moved_grids_share_their_nodes_to_the_bit(moves):
    grid = PAPER
    for f_steps, d_steps in moves:
        before, grid = grid, grid.moved(f_steps, d_steps)
        kept = max(0, 5 - abs(f_steps)) * max(0, 5 - abs(d_steps))
        assert len(set(before.nodes()) & set(grid.nodes())) >= kept
    assert all(f > 0 and d > 0 for f, d in grid.nodes())


def test_an_optimum_on_an_edge_moves_the_grid_two_steps_that_way():
    moved = PAPER.recentred(PAPER.f_max[-1], PAPER.delta_max[0])
    assert moved.f_factors == (1.0, 1.1, 1.2, 1.3, 1.4)
    assert moved.delta_factors == (0.6, 0.7, 0.8, 0.9, 1.0)
    assert PAPER.recentred(70.0, 1.1e-4) == PAPER
    assert PAPER.is_edge(85.2, 1.1e-4)
    assert not PAPER.is_edge(85.1, 1.1e-4)


def test_a_grid_never_reaches_zero():
    assert min(PAPER.moved(-50, 0).f_factors) == pytest.approx(0.1)


@pytest.mark.parametrize(
    "change",
    [
        {"centre": (0.0, 1e-4)},
        {"centre": (71.0, float("nan"))},
        {"f_factors": (0.9, 1.1)},
        {"f_factors": (1.0, 0.9, 1.1)},
        {"delta_factors": (-0.1, 0.9, 1.1)},
    ],
)
def test_refusals(change):
    with pytest.raises(InputError, match="grid"):
        Design(**{"centre": (71.0, 1.14e-4), **change})

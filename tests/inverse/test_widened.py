"""More than two parameters on a sparse grid: truth recovered, intervals that hold it, and honesty where they cannot."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.inverse.discrepancy import Discrepancy
from pipeline.inverse.estimate import Settings, Surrogate
from pipeline.inverse.objective import Objective
from pipeline.inverse.observations import Simulated
from pipeline.inverse.sparse import SparseGrid
from pipeline.inverse.widened import widen

from .hinge import CENTRE, field, load, measured

NAMES = ("f_max", "delta_max", "modulus")
GRID = SparseGrid(np.array([*CENTRE, 1.0]), np.array([0.2 * CENTRE[0], 0.2 * CENTRE[1], 0.1]))
NOISE_ALONE = Settings(Objective.BOTH, 0.0, surrogate=Surrogate.DATA, discrepancy=Discrepancy(field=0.0, load=0.0))


def model(f_max, delta_max, modulus):
    """The hinge with another modulus: (K, f_max) → s(K, f_max) leaves fields and multiplies the load."""
    return field(f_max / modulus, delta_max), modulus * load(f_max / modulus, delta_max)


def simulations(blind=False):
    """Every node of the grid; blind: the third parameter does nothing."""
    runs = [model(f, d, 1.0 if blind else m) for f, d, m in GRID.nodes]
    return Simulated(np.stack([u for u, _ in runs])[:, None], np.stack([p for _, p in runs])[:, None])


def test_three_parameters_are_found_together():
    truth = (1.04 * CENTRE[0], 0.95 * CENTRE[1], 1.03)
    data = measured((truth[0] / truth[2], truth[1]), None)
    found = widen(NAMES, GRID, simulations(), _scaled(data, truth[2]), NOISE_ALONE)
    assert found.minimum.position == pytest.approx(truth, rel=5e-3)  # degree two in products over ±20 %
    assert found.determined.all()
    assert found.warnings == ()


def test_intervals_hold_the_truth_at_their_rate():
    truth = np.array([1.04 * CENTRE[0], 0.95 * CENTRE[1], 1.03])
    runs, inside = simulations(), np.zeros(3)
    for seed in range(30):
        data = _scaled(measured((truth[0] / truth[2], truth[1]), np.random.default_rng(seed)), truth[2])
        low, high = widen(NAMES, GRID, runs, data, NOISE_ALONE).intervals.T
        inside += (low <= truth) & (truth <= high)
    assert (inside >= 24).all()  # of 30 at 95 %: fewer than 24 has a probability below 1e-3


def test_a_parameter_without_effect_is_said_to_be_undetermined():
    found = widen(NAMES, GRID, simulations(blind=True), measured(CENTRE, np.random.default_rng(1)), NOISE_ALONE)
    assert any("modulus" in text or "tell them apart" in text for text in found.warnings)


def test_other_simulations_than_the_grids_are_refused():
    runs = simulations()
    assert runs.displacement is not None
    assert runs.load is not None
    with pytest.raises(InputError, match="24 simulations are not the 25 nodes"):
        widen(NAMES, GRID, Simulated(runs.displacement[1:], runs.load[1:]), measured(CENTRE, None), NOISE_ALONE)


def _scaled(data, modulus):
    """The measurement of a specimen whose modulus is a multiple: the load with it."""
    return replace(data, load=modulus * data.load)

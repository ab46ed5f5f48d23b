"""The factors of the irregular network, from integral geometry and counted on straight cuts."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import MM
from pipeline.twin.calibration import calibrated_factors, check_factors
from pipeline.twin.network import irregular_network

BEAM = SingleEdgeNotchedBeam(60 * MM, 130 * MM, 137 * MM, 40 * MM, 15 * MM)


@pytest.mark.parametrize("seed", [0, 1])
def test_cut_bonds_carry_strength_and_energy_of_the_lattice(seed: int) -> None:
    network = irregular_network(BEAM, 1.14 * MM, np.random.default_rng(seed))
    found = check_factors(network, calibrated_factors(), np.random.default_rng(9), 400)
    # four standard errors of the mean of 400 cuts
    assert found.strength == pytest.approx(1, abs=4 * found.strength_std / 20)
    assert found.energy == pytest.approx(1, abs=4 * found.energy_std / 20)


def test_factors_are_the_closed_forms() -> None:
    factors = calibrated_factors()
    assert factors.strength == 1
    assert factors.opening * (4 / np.pi) == pytest.approx(2 / np.sqrt(3), rel=1e-15)  # round-off

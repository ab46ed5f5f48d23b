"""What a simulated test reports about itself."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.lmp.simulate import solve
from pipeline.study import simulate


@pytest.fixture(scope="module")
def beam():
    problem = small_beam(2.0e-3, cmod_max=0.3e-3, accuracy=0.03)
    return problem, solve(problem)


def test_phases_share_what_was_broken(beam):
    problem, solution = beam
    shares = simulate.breakage(problem, solution)
    result = simulate.test_result(problem, solution, np.zeros((0, 2)), np.zeros((len(solution.cmod), 0, 2)))
    assert sum(share["broken_bonds"] for share in shares.values()) == result["broken_bonds"] > 0
    total = sum(share["dissipated_j"] for share in shares.values())
    assert total == pytest.approx(result["dissipated_j"], rel=1e-6)  # the engine sums in its own order
    assert shares["aggregate"]["broken_bonds"] == 0  # three times as strong, and no crack in its way
    assert shares["mastic"]["dissipated_j"] > 0

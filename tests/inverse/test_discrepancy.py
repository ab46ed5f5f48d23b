"""The discrepancy: the stated covariance, and an amplitude estimate without bias."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.inverse.discrepancy import Discrepancy, unit_waves, waves
from pipeline.inverse.objective import Objective, Rigid

from .hinge import POINTS, STATIONS
from .linear import comparison, fit, measured, white

NOTHING = (np.zeros((10, 16, 2)), np.zeros(10))
SETTING = Discrepancy()


def drawn(rng: np.random.Generator, field: float, load: float) -> tuple[np.ndarray, np.ndarray]:
    """Errors with the discrepancy's covariance, by Cholesky factors written down here."""
    along = np.linalg.cholesky(np.exp(-np.abs(np.subtract.outer(STATIONS, STATIONS)) / 0.4e-3))
    apart = np.sum((POINTS[:, None] - POINTS[None]) ** 2, axis=-1)
    flank = np.sign(POINTS[:, 0])
    across = np.linalg.cholesky(np.exp(-apart / 2 / 10e-3**2) * (flank[:, None] == flank) + 1e-10 * np.eye(16))
    return field * np.einsum(
        "st,pq,tqx->spx", along, across, rng.standard_normal((10, 16, 2))
    ), load * along @ rng.standard_normal(10)


def test_unit_waves_have_the_stated_covariance():
    compared = comparison(measured(*NOTHING), Objective.FIELDS, Rigid.KEEP)
    columns = unit_waves(compared, SETTING)["field"]
    covariance = (columns @ columns.T).reshape(10, 16, 2, 10, 16, 2)
    same = np.einsum("spxsqx->spqx", covariance)[0, ..., 0]
    # 1e-3 of the trace is left out of each factor: 16e-3 and 10e-3 at most in one entry
    assert same[0, 0] == pytest.approx(1, abs=2e-2)
    assert same[0, 1] == pytest.approx(np.exp(-(1.5**2) / 2 / 10**2), abs=2e-2)
    assert same[0, 15] == pytest.approx(0, abs=1e-12)  # the other flank
    assert covariance[0, 0, 0, 8, 0, 0] == pytest.approx(np.exp(-1), abs=2e-2)  # eight stations of 0.05 mm
    assert covariance[0, 0, 0, 0, 0, 1] == pytest.approx(0, abs=1e-12)  # components are independent


@pytest.mark.parametrize(("objective", "rigid"), [("fields", "fit"), ("fields", "keep"), ("load", "fit")])
def test_amplitudes_are_estimated_in_the_middle(objective, rigid):
    rng, found = np.random.default_rng(5), []
    for _ in range(60):
        errors = [a + b for a, b in zip(drawn(rng, 3e-6, 60.0), white(rng), strict=True)]
        one = fit(measured(*errors), Objective(objective), Rigid(rigid))
        waved = waves(one.comparison, SETTING, one.residual, one.slopes)
        found.append({w.kind: (w.amplitude, w.freedom) for w in waved})
    truth = {"field": 3e-6, "load": 60.0}
    for kind in found[0]:
        amplitude, freedom = np.array([one[kind] for one in found]).T
        # the median of 60 estimates that scatter by 1/√(2ν), twice its standard error, and the skew of χ²
        spread = 1 / np.sqrt(2 * np.median(freedom))
        assert np.median(amplitude) == pytest.approx(truth[kind], rel=2 * 1.25 * spread / np.sqrt(60) + 0.1)
        assert np.std(np.log(amplitude)) == pytest.approx(spread, rel=0.4)  # the stated degrees of freedom are true


def test_residuals_of_noise_alone_ask_for_little():
    rng = np.random.default_rng(6)
    found = []
    for _ in range(60):
        one = fit(measured(*white(rng)), Objective.FIELDS)
        found.append(waves(one.comparison, SETTING, one.residual, one.slopes)[0].amplitude)
    assert min(found) >= 0
    assert np.median(found) < 0.5 * 0.4e-6  # long waves average the noise over many points


def test_a_given_amplitude_is_taken():
    one = fit(measured(*NOTHING), Objective.BOTH)
    found = waves(one.comparison, Discrepancy(field=2e-6), one.residual, one.slopes)
    assert [(w.kind, w.amplitude, w.freedom) for w in found if w.kind == "field"] == [("field", 2e-6, np.inf)]
    assert (
        next(w for w in found if w.kind == "load").amplitude < 0.01 * 5.0
    )  # nothing is left of exact loads: below noise


@pytest.mark.parametrize("change", [{"length": 0.0}, {"spread": -1.0}, {"field": -1e-6}, {"load": float("nan")}])
def test_refusals(change):
    with pytest.raises(InputError, match=r"discrepanc|correlation"):
        Discrepancy(**change)

"""Burgers constants from records with and without noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.burgers_fit import NAMES, fit_burgers

READINGS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000.0])  # s, AASHTO T 322
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)


@settings(max_examples=25)
@given(st.floats(-11, -7), st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(0.8, 2.2))
def test_exact_data_give_the_constants_back(d1, d2, flow, tau2):
    truth = Burgers(10**d1, 10 ** (d1 + d2), 10 ** (3 - d1 - flow), 10**tau2)
    found = fit_burgers(READINGS, truth.creep_compliance(READINGS))
    for name in NAMES:
        assert getattr(found.model, name) == pytest.approx(getattr(truth, name), rel=1e-5)  # stop of the solver
    assert found.rms_log_error < 1e-8  # likewise, squared


def test_intervals_hold_the_truth_as_often_as_they_say():
    random, count = np.random.default_rng(5), 20
    held = dict.fromkeys(NAMES, 0)
    for _ in range(count):
        noise = np.exp(0.02 * random.normal(size=READINGS.size))
        found = fit_burgers(READINGS, MASTIC.creep_compliance(READINGS) * noise)
        for name in NAMES:
            low, high = found.interval[name]
            held[name] += low <= getattr(MASTIC, name) <= high
            assert low < getattr(found.model, name) < high
    # 95 % of 20; fewer than 15 have a chance of 3e-4
    assert all(15 <= n <= 20 for n in held.values()), held


def test_bands_hold_the_true_curves():
    random = np.random.default_rng(7)
    time, held = np.logspace(-0.5, 3.3, 20), []
    for _ in range(30):
        noise = np.exp(0.02 * random.normal(size=READINGS.size))
        found = fit_burgers(READINGS, MASTIC.creep_compliance(READINGS) * noise)
        low, high = found.band(lambda model: model.relaxation_modulus(time))
        truth = MASTIC.relaxation_modulus(time)
        held.append(np.mean((low <= truth) & (truth <= high)))
        low, high = found.band(lambda model: model.creep_compliance(time))
        assert (low < found.model.creep_compliance(time)).all()
        assert (high > found.model.creep_compliance(time)).all()
    assert np.mean(held) > 0.85  # 95 % pointwise, 30 records whose points go together


def test_waves_in_the_residual_widen_the_interval():
    time = np.logspace(0, 3, 60)
    random = np.random.default_rng(1)
    white = 0.01 * random.normal(size=time.size)
    wave = 0.01 * np.sqrt(2) * np.sin(2 * np.pi * np.log10(time) / 0.6)
    even, wavy = (fit_burgers(time, MASTIC.creep_compliance(time) * np.exp(e)) for e in (white, wave))
    assert even.correlation < 0.4
    assert wavy.correlation > 0.8  # twelve readings a wave: ρ ≈ cos 30°
    assert np.ptp(np.log(wavy.interval["d1"])) > 2 * np.ptp(np.log(even.interval["d1"]))


def test_what_the_record_does_not_show_has_no_bound():
    # no flow within 1000 s: eta1 may be anything above a value, the other constants are found
    solid = 1e-10 + 0.7e-10 * -np.expm1(-READINGS / 30)
    noise = np.exp(0.01 * np.random.default_rng(3).normal(size=READINGS.size))
    found = fit_burgers(READINGS, solid * noise)
    assert found.unbounded == ("eta1",)
    low, high = found.interval["eta1"]
    assert np.isnan(high)
    assert low > 1000 / (0.2 * 1.7e-10)  # less than a fifth of D(1000 s) is flow
    assert found.interval["tau2"][0] < 30 < found.interval["tau2"][1]


def test_replicates_and_order_do_not_matter():
    time = np.concatenate([READINGS, READINGS[::-1]])
    compliance = MASTIC.creep_compliance(time)
    found = fit_burgers(time, compliance)
    assert found.model.tau2 == pytest.approx(MASTIC.tau2, rel=1e-5)  # stop of the solver
    assert (np.diff(found.time) >= 0).all()


@pytest.mark.parametrize(
    ("time", "compliance", "sentence"),
    [
        (READINGS[:5], 1e-10 + 1e-12 * READINGS[:5], "5 readings of creep compliance: a Burgers fit needs at least 6"),
        (np.linspace(1, 9, 9), 1e-10 + 1e-12 * np.arange(9), "needs at least a decade of time"),
        (READINGS, 1e10 / (1 + READINGS), "does not grow"),
        (READINGS, -READINGS, "compliance = -1 1/Pa must be positive"),
        (READINGS - 1, READINGS, "time = 0 s must be positive"),
    ],
)
def test_a_refusal_says_what_is_wrong(time, compliance, sentence):
    with pytest.raises(InputError, match=sentence):
        fit_burgers(time, compliance)

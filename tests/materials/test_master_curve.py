"""Shifts between temperatures and the laws they follow."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.master_curve import MasterCurve, creep_master_curve, dynamic_master_curve
from pipeline.materials.series_fit import fit_dynamic, spaced_times
from pipeline.materials.shift_laws import GAS_CONSTANT, Arrhenius, Wlf, fit_arrhenius, fit_wlf

READINGS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000.0])  # s, AASHTO T 322
LEVELS = np.array([-24, -12, 0.0]) + 273.15
LAW = Wlf(15.0, 120.0, LEVELS[1])
# spread over decades as asphalt is
CHAIN = KelvinChain(5e-11, 1e-14, np.geomspace(0.1, 3, 8) * 1e-10, np.geomspace(0.03, 3e4, 8))
TIME, TEMPERATURE = np.tile(READINGS, 3), np.repeat(LEVELS, READINGS.size)


def compliance(noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Three isotherms of one chain, shifted by the law."""
    scatter = np.exp(noise * np.random.default_rng(seed).normal(size=TIME.size))
    return CHAIN.creep_compliance(TIME / 10 ** LAW.log_shift(TEMPERATURE)) * scatter


def curve_of(law: Wlf | Arrhenius, levels: np.ndarray, std: float) -> MasterCurve:
    """A master curve whose shifts follow a law exactly, known to `std`."""
    free = levels != law.reference
    covariance = np.diag(np.where(free, std**2, 0.0))
    return MasterCurve(levels, law.reference, law.log_shift(levels), covariance, np.ones(3), 0.01, 20, ())


def test_free_shifts_of_one_chain_are_found():
    found = creep_master_curve(TIME, compliance(), TEMPERATURE, LEVELS[1])
    assert found.log_shift == pytest.approx(LAW.log_shift(LEVELS), abs=5e-3)  # two terms a decade for other times
    assert found.rms < 3e-3
    assert found.apart == ()
    assert found.abscissa == pytest.approx(TIME / 10 ** LAW.log_shift(TEMPERATURE), rel=0.012)  # 5e-3 of a decade


def test_shift_intervals_hold_the_truth():
    errors = []
    for seed in range(25):
        found = creep_master_curve(TIME, compliance(0.02, seed), TEMPERATURE, LEVELS[1])
        low, high = found.interval.T
        truth = LAW.log_shift(LEVELS)
        errors.append((low <= truth + 1e-12) & (truth <= high + 1e-12))
    assert np.mean(np.array(errors)[:, [0, 2]]) > 0.85  # 95 % of 50, less than 43 has a chance of 1e-3


def test_the_reference_only_moves_the_origin():
    cold, middle = (creep_master_curve(TIME, compliance(0.01), TEMPERATURE, LEVELS[k]) for k in (0, 1))
    assert np.diff(cold.log_shift) == pytest.approx(np.diff(middle.log_shift), abs=2e-3)  # other places of the terms
    assert cold.log_shift[0] == 0


def test_isotherms_that_do_not_overlap_are_named():
    warm = np.where(np.isclose(TEMPERATURE, LEVELS[2]), 10.0, 1.0)
    found = creep_master_curve(TIME, compliance() * warm, TEMPERATURE, LEVELS[1])
    assert found.apart == ((LEVELS[1], LEVELS[2]),)


def test_wlf_is_found_exactly_and_with_its_uncertainty():
    levels = np.array([-30, -20, -10, 0, 10.0]) + 273.15
    law = Wlf(17.0, 110.0, levels[2])
    found = fit_wlf(curve_of(law, levels, 1e-3))
    assert (found.law.c1, found.law.c2) == pytest.approx((17.0, 110.0), rel=1e-6)  # stop of the solver
    assert found.rms < 1e-7
    for name, truth in (("c1", 17.0), ("c2", 110.0)):
        low, high = found.interval[name]
        assert low < truth < high
        assert high / low < 1.3


def test_arrhenius_is_found_exactly_and_with_its_uncertainty():
    levels = np.array([-30, -20, -10.0]) + 273.15
    law = Arrhenius(2e5, levels[0])
    found = fit_arrhenius(curve_of(law, levels, 0.01))
    assert found.law.energy == pytest.approx(2e5, rel=1e-12)  # a quotient of sums
    low, high = found.interval["energy"]
    # one unknown, two readings x = (1/T − 1/T_r)/(R ln 10): σ/|x|, Student's t of 20
    slope = law.log_shift(levels[1:]) / 2e5
    assert high - low == pytest.approx(2 * 2.086 * 0.01 / np.linalg.norm(slope), rel=1e-3)  # digits of t


def test_arrhenius_by_hand():
    law = Arrhenius(GAS_CONSTANT * np.log(10) * 1000.0, 250.0)
    assert law.log_shift(200.0) == pytest.approx(1000 * (1 / 200 - 1 / 250), rel=1e-14)  # = 1


def test_scatter_of_the_shifts_about_a_law_counts():
    levels = np.array([-30, -20, -10, 0, 10.0]) + 273.15
    exact = curve_of(Arrhenius(2e5, levels[2]), levels, 1e-3)
    off = MasterCurve(**vars(exact) | {"log_shift": exact.log_shift + 0.2 * np.array([1, -1, 0, 1, -1])})
    assert np.ptp(fit_arrhenius(off).interval["energy"]) > 20 * np.ptp(fit_arrhenius(exact).interval["energy"])


def test_binder_sweep_of_the_laboratory(shared_data):
    rows = np.genfromtxt(
        shared_data / "fhwa_asphalt" / "binder_frequency_sweep_lane1_recovered_rep1.csv", delimiter=",", names=True
    )
    modulus = rows["Gp_Pa"] + 1j * rows["Gpp_Pa"]
    found = dynamic_master_curve(rows["omega_rad_s"], modulus, rows["T_C"] + 273.15, 46 + 273.15)
    assert found.temperature.size == 7
    assert (np.diff(found.log_shift) < 0).all()  # warmer is faster
    assert found.apart == ()
    assert found.rms < 0.025  # measured: 2.2 %; the file itself is consistent to 1.2 %
    terms = spaced_times(0.1 / found.abscissa.max(), 10 / found.abscissa.min())
    series = fit_dynamic(found.abscissa, modulus, terms)
    difference = np.abs(series.complex_modulus(found.abscissa) / modulus - 1)
    assert np.sqrt(np.mean(difference**2)) < 0.025  # measured: 2.2 %
    wlf, arrhenius = fit_wlf(found), fit_arrhenius(found)
    assert wlf.rms < 0.05  # of a decade; measured: 0.037
    assert arrhenius.rms > 5 * wlf.rms  # across the glass transition WLF bends as binders do
    assert 5 < wlf.law.c1 < 25  # the range of binders
    assert 80 < wlf.law.c2 < 220


@pytest.mark.parametrize(
    ("keep", "reference", "sentence"),
    [
        (np.isclose(TEMPERATURE, LEVELS[0]), LEVELS[0], "two temperatures at least"),
        (TIME != 0, 280.0, r"reference temperature 6\.85 °C was not measured: there are -24, -12, 0 °C"),
        (~np.isclose(TEMPERATURE, LEVELS[2]) | (TIME > 400), LEVELS[0], "2 readings at 0 °C: a master curve needs 3"),
    ],
)
def test_a_refusal_says_what_is_missing(keep, reference, sentence):
    with pytest.raises(InputError, match=sentence):
        creep_master_curve(TIME[keep], compliance()[keep], TEMPERATURE[keep], reference)


def test_wlf_needs_three_temperatures_and_a_bend():
    two = curve_of(Arrhenius(2e5, 250.0), np.array([250.0, 260.0]), 0.01)
    with pytest.raises(InputError, match="three temperatures"):
        fit_wlf(two)
    levels = np.array([250.0, 260, 270, 280])
    straight = curve_of(Wlf(1e6, 1e7, 260.0), levels, 1e-4)
    with pytest.raises(InputError, match="cannot be told apart"):
        fit_wlf(straight)

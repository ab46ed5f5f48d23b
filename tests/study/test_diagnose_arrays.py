"""The arrays of a diagnosis are those that its figures and sums were made of."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.gap.diagnosis import diagnose
from pipeline.gap.modes import MODES, shapes
from pipeline.gap.observation import Reading
from pipeline.gap.score import NONE
from pipeline.store.layouts import DIAGNOSE
from pipeline.store.results import read_arrays, write_arrays
from pipeline.study.diagnose_arrays import diagnosis_arrays, mode_arrays, reading_of, whole_curve
from tests.gap.scene import ABSCISSAE, START, entry, measured, observed, sight, simulate

PATH = np.array([[0.0, 15e-3], [0.0, 40e-3]])


@pytest.fixture(scope="module")
def diagnosis():
    test = measured(["cmod_gain"], [0.06], np.random.default_rng(3))
    few = (0.8, 1.0, 1.2)
    return diagnose(test, ABSCISSAE, simulate, START, entry(), np.random.default_rng(0), ["cmod_gain", "modulus"], few)


def test_what_is_written_is_read_again_and_holds_chi_square(diagnosis, tmp_path):
    write_arrays(tmp_path, DIAGNOSE, diagnosis_arrays(diagnosis, PATH))
    found = read_arrays(tmp_path, DIAGNOSE)
    assert list(found["explanations"])[:2] == [NONE, "cmod_gain"]
    best = list(found["explanations"]).index(diagnosis.best.candidate.label)
    parts = ("displacement_m", "load_n")
    measured_, simulated = (
        np.concatenate([np.ravel(found[f"{who}/{p}"][at]) for p in parts])
        for who, at in (("measured", slice(None)), ("simulated", best))
    )
    left = (measured_ - simulated)[found["compared"]]
    assert left @ np.linalg.solve(found["covariance"], left) == pytest.approx(diagnosis.best.chi_square, rel=1e-6)


def test_a_whole_curve_passes_through_the_stations(diagnosis):
    fitted = diagnosis.best
    cmod, load = whole_curve(diagnosis, fitted)
    at = diagnosis.observation.sight.cmod
    expected = reading_of(diagnosis, fitted).load
    assert np.allclose(np.interp(at, cmod, load), expected, atol=2e-3 * expected.max())  # chords of 2 µm of CMOD


def test_amplitudes_of_modes_are_those_put_in():
    seen = sight()
    nothing = Reading(np.zeros((seen.cmod.size, len(seen.points), 2)), np.zeros(seen.cmod.size))
    size = np.linspace(1e-6, 5e-6, seen.cmod.size)
    opened = observed(
        seen, Reading(size[:, None, None] * shapes(seen)[..., MODES.index("opening")], nothing.load), None
    )
    found = mode_arrays(opened, np.diag(opened.noise), [nothing])
    expected = np.zeros((len(MODES), seen.cmod.size))
    expected[MODES.index("opening")] = size
    assert np.allclose(found["modes/amplitude_m"][0], expected, atol=1e-12)  # least squares without noise
    assert np.allclose(found["modes/std_m"], found["modes/noise_std_m"])  # here Σ is noise alone

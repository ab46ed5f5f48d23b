"""The scatter of the load, against known noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.store.noise import estimate_load_noise


@pytest.fixture
def dense():
    """2000 rows of the record of the fixture `curve`: its own bend is far below the noise."""
    x = np.linspace(0, 11, 2000)
    return LoadCurve(x, x * 5e-5, 3000 * x * np.exp(1 - x))


@pytest.mark.parametrize("std", [2.0, 5.0, 20.0])
def test_white_noise_is_found(dense, std):
    estimates = [
        estimate_load_noise(replace(dense, load=dense.load + np.random.default_rng(s).normal(0, std, 2000)))
        for s in range(20)
    ]
    # the median of 2000 absolute values scatters by 2.6 % (correlated differences), the mean of 20 by 0.6 %
    assert np.mean(estimates) == pytest.approx(std, rel=0.03)
    assert estimates == pytest.approx([std] * 20, rel=0.15)  # five standard deviations and the bend of the curve


def test_single_jumps_do_not_matter(dense):
    noisy = dense.load + np.random.default_rng(0).normal(0, 5, 2000)
    jumps = noisy.copy()
    jumps[[300, 800, 1500]] += 800
    before, after = (estimate_load_noise(replace(dense, load=load)) for load in (noisy, jumps))
    assert after == pytest.approx(before, rel=0.02)  # nine of 1998 differences move the median by less


def test_coarse_steps_count_as_rounding(dense):
    """Where most neighbours are equal the median is zero; rounding to 50 N leaves 50/√12."""
    rounded = np.round(dense.load / 50) * 50
    assert estimate_load_noise(replace(dense, load=rounded)) == pytest.approx(50 / np.sqrt(12), rel=1e-12)


def test_a_noise_free_record_keeps_the_resolution_of_a_load_cell():
    x = np.linspace(0, 1, 100)
    assert estimate_load_noise(LoadCurve(x, x, np.minimum(x, 0.5) * 4000)) >= 1e-4 * 2000

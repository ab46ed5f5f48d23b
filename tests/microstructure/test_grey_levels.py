"""Thresholds on samples of known populations."""

import numpy as np
import pytest

from pipeline.microstructure.grey_levels import otsu_threshold, valley, void_threshold


def sample(*populations, seed=0):
    """Grey levels of Gaussian populations (count, mean, standard deviation)."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(mean, std, count) for count, mean, std in populations])


def test_otsu_lies_midway_between_equal_populations():
    values = sample((40000, 60, 10), (40000, 140, 10))
    assert otsu_threshold(values) == pytest.approx(100, abs=4)  # the criterion is flat where nobody lies


@pytest.mark.parametrize("gain", [1e-3, 1.0, 300.0])
def test_otsu_goes_with_the_gain(gain):
    values = sample((3000, 60, 8), (1000, 140, 8))
    assert otsu_threshold(gain * values) == pytest.approx(gain * otsu_threshold(values), rel=1e-3)  # 16-bit rounding


@pytest.mark.parametrize("shape", ["normal", "uniform", "exponential", "lognormal"])
def test_one_population_has_no_valley(shape):
    rng = np.random.default_rng(1)
    values = 100 + 10 * {"normal": rng.normal, "uniform": rng.uniform, "exponential": rng.exponential}.get(
        shape, lambda size: rng.lognormal(0, 0.4, size)
    )(size=40000)
    assert valley(values, otsu_threshold(values)) > 0.85  # 1 but for counting noise of about 1/√600


@pytest.mark.parametrize(("apart", "deepest"), [(3, 0.8), (4, 0.35), (6, 0.05)])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_two_populations_have_one(apart, deepest, share):
    """Two equal Gaussians d apart: valley over peak is 2 exp(−d²/8), 0.65, 0.27, 0.02; more for unequal ones."""
    values = sample((round(40000 * share), 100, 10), (round(40000 * (1 - share)), 100 + 10 * apart, 10))
    assert valley(values, otsu_threshold(values)) < deepest * (1 if share == 0.5 else 1.4)


@pytest.mark.parametrize("count", [100, 1000, 10000])
def test_voids_are_parted_halfway(count):
    values = sample((40000, 100, 6), (50000, 180, 6), (count, 10, 4))
    assert void_threshold(values, 140.0) == pytest.approx(55, abs=3)  # medians of 10 and 100


def test_a_dark_stone_halfway_does_not_hide_the_voids():
    values = sample((40000, 60, 5), (50000, 160, 6), (2900, 10, 2), (900, 36, 1))
    assert 16 < void_threshold(values, 110.0) < 33  # three standard deviations from voids and stone


def test_tails_are_no_voids():
    assert void_threshold(sample((40000, 100, 8), (50000, 180, 8)), 140.0) is None
    rng = np.random.default_rng(2)
    smear = np.concatenate(
        [sample((40000, 100, 4), (50000, 180, 6)), rng.uniform(10, 90, 4000)]
    )  # a tail, no population
    assert void_threshold(smear, 140.0) is None

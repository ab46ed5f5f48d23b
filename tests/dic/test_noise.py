"""What noise explains."""

import numpy as np
import pytest
from scipy import signal

from pipeline.dic.correlate import correlate
from pipeline.dic.motion import Affine
from pipeline.dic.noise import MatchNoise, deviation
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Speckle, photograph, photograph_pair
from pipeline.dic.static import static_noise


def test_white_noise_sets_the_limits():
    random = np.random.default_rng(0)
    count = np.full(4000, 625)
    residual = 4.0 * random.chisquare(617, 4000)
    noise = MatchNoise.learnt(residual, count, np.full(4000, 10.5))
    assert noise.variance == pytest.approx(4.0, rel=0.005)  # median of χ²(617)/617 over 4000 draws
    assert noise.excess == pytest.approx(1.0, abs=0.1)  # a quantile of 4000 draws
    assert (residual / 617 <= noise.limit(count)).all()  # six deviations
    assert noise.limit(np.array([625]))[0] == pytest.approx(4 * (1 + 6 * np.sqrt(2 / 617)), rel=0.05)


def test_a_crack_among_the_subsets_does_not_move_the_limit():
    random = np.random.default_rng(0)
    residual = 4.0 * random.chisquare(617, 4000)
    residual[:800] *= 30
    assert MatchNoise.learnt(residual, np.full(4000, 625), np.ones(4000)).variance == pytest.approx(4.0, rel=0.03)


def test_noise_in_the_gradients_counts_as_a_loss():
    plain = deviation(np.array([[1e-5, 1e-5]]), np.array([0]), np.array([8.0]))
    lossy = deviation(np.array([[1e-5, 1e-5]]), np.array([625]), np.array([8.0]))
    assert plain[0, 0] == pytest.approx(np.sqrt(8e-5))  # Cramér–Rao
    assert lossy[0, 0] / plain[0, 0] == pytest.approx(
        1 / (1 - 1.3923 * 4 * 625 * 1e-5), rel=1e-3
    )  # errors in variables


def test_slope_of_a_spline_through_white_noise():
    # the same filter written in frequency: 3 sin ω / (2 + cos ω)
    noise = np.random.default_rng(1).normal(size=200_000)
    slope = signal.cspline1d_eval(signal.cspline1d(noise), np.arange(noise.size) + 1e-4)
    slope = (slope - signal.cspline1d_eval(signal.cspline1d(noise), np.arange(noise.size) - 1e-4)) / 2e-4
    assert slope.var() == pytest.approx(1.3923, rel=0.02)  # 200,000 draws


def test_static_pairs_show_what_gradients_predict():
    speckle, random = Speckle.scattered((300, 300), np.random.default_rng(3)), np.random.default_rng(4)
    pictures = [
        photograph(speckle, (300, 300), Affine((0.3 * k, 0.1 * k)), Camera(), random) for k in range(4)
    ]  # a specimen at rest, a camera that drifts
    found = static_noise(pictures, Settings(threads=1))
    np.testing.assert_allclose(found.drift, [[0.3, 0.1], [0.6, 0.2], [0.9, 0.3]], atol=0.003)  # 0.01 px, 150 subsets
    assert found.factor == pytest.approx(1.0, abs=0.15)  # splines between pixels let less noise through
    np.testing.assert_allclose(found.predicted, 0.0095, rtol=0.15)  # 0.0098 px is the bound of this speckle


def test_the_noise_of_the_camera_is_reported():
    pair = photograph_pair(Affine((0.5, 0.5)), (200, 200), 2, Camera(noise=3.0, bits=None))
    found = correlate(pair.reference, pair.deformed, Settings(threads=1))
    # one picture's noise whole, the other's as far as the spline at half a pixel lets it through
    assert 3.0 < found.noise < 3.0 * np.sqrt(2)

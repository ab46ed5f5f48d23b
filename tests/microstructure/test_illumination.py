"""Light of known shape is taken out; noise goes; the outside takes the nearest value inside."""

import numpy as np
import pytest

from pipeline.microstructure.illumination import denoise, fill_outside, flatten

from .photograph import draw


@pytest.mark.parametrize("strength", [0.1, 0.5, 1.0])
def test_a_polynomial_light_on_two_grey_levels_is_found(strength):
    """Two levels times exp(cubic): what is left are the two levels."""
    stone = draw(3, noise=0, light=0).stone > 0
    y, x = np.mgrid[-1 : 1 : stone.shape[0] * 1j, -1 : 1 : stone.shape[1] * 1j]
    light = strength * (0.5 * x - 0.3 * y + 0.2 * x * y - 0.3 * x**2 + 0.1 * y**3)
    image = (np.where(stone, 70, 150) * np.exp(light)).astype(np.float32)
    log = np.log(flatten(image, np.ones(stone.shape, bool), 3))
    for phase in (stone, ~stone):
        assert log[phase].std() < 1e-5  # single precision of logarithms of about 5
    assert log[~stone].mean() - log[stone].mean() == pytest.approx(np.log(150 / 70), abs=1e-5)  # as above


def test_even_light_is_left_alone():
    image = draw(4, light=0).image.astype(np.float32)
    assert flatten(image, np.ones(image.shape, bool), 0) is image
    ratio = flatten(image, np.ones(image.shape, bool), 3) / image
    assert np.std(ratio / ratio.mean()) < 0.02  # 60 stones of tones varied by 6 of 70 carry a smooth part of 6/70/√60


def test_noise_goes_with_the_size():
    noise = np.random.default_rng(0).normal(100, 10, (300, 300)).astype(np.float32)
    spread = [denoise(noise, size).std() for size in (0.5, 1.0, 2.0, 4.0)]
    assert spread[0] == noise.std()
    assert spread == sorted(spread, reverse=True)
    # white noise of 10 under a Gaussian of standard deviation s keeps 10/(2 s √π); the median before takes some more
    assert spread[3] < 10 / (2 * 2 * np.sqrt(np.pi))


def test_outside_takes_the_nearest_value():
    mask = np.zeros((20, 30), bool)
    mask[5:15, 10:20] = True
    image = np.where(mask, np.arange(600).reshape(20, 30), -1)
    filled = fill_outside(image, mask)
    assert np.array_equal(filled[mask], image[mask])
    assert filled[0, 12] == image[5, 12]
    assert filled[7, 29] == image[7, 19]
    assert filled[0, 0] == image[5, 10]

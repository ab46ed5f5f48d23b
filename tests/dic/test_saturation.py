"""Saturated, dark and defective pixels: points fail with the reason, or the answer is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.dic.benchmark import WRONG_PX, count
from pipeline.dic.correlate import correlate
from pipeline.dic.motion import Affine, Cracked, Cut
from pipeline.dic.saturation import Range
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Pair, photograph_pair
from pipeline.dic.status import Status
from pipeline.dic.track import track

MOTION = Affine((1.3, -0.7), ((1e-3, 0.0), (0.0, 2e-3)), (110.0, 110.0))
SHAPE = (220, 220)


def pair(before: Camera | None = None, after: Camera | None = None) -> Pair:
    return photograph_pair(MOTION, SHAPE, 5, before or Camera(), after or before or Camera())


def spoilt(fault: np.ndarray, value: int = 255) -> Pair:
    """Both pictures with the same fault, fixed to the sensor."""
    good = pair()
    return replace(good, **{n: np.where(fault, value, getattr(good, n)) for n in ("reference", "deformed")})


def judged(seen: Pair, settings: Settings):
    """The result, and how far each valid point is off, px."""
    found = correlate(seen.reference, seen.deformed, settings)
    off = np.linalg.norm(found.displacement - seen.truth(found.points), axis=1)
    return found, off[found.valid]


@pytest.mark.parametrize("levels", [256, 1024, 4096, 65536])
def test_the_ceiling_is_found_at_any_depth(levels):
    light = np.random.default_rng(0).normal(0.6, 0.2, (200, 200)).clip(0.01, None) * levels
    told = Range.of(np.minimum(np.rint(light), levels - 1))
    assert told.ceiling == levels - 1
    assert told.floor == -np.inf
    assert Range.of(np.rint(light * 0.3).astype(np.float32)) == Range()  # exposed as it should be
    assert Range.of(np.maximum(np.rint(light - 0.5 * levels), 0)).floor == 0


@pytest.mark.parametrize("gain", [1.5, 2.0])
def test_some_saturated_speckle_is_matched_by_the_rest(gain, one_core):
    found, off = judged(pair(Camera(gain=gain)), one_core)
    assert found.valid.mean() > 0.99
    assert np.sqrt(np.mean(off**2) / 2) < 0.0115  # as without
    assert off.max() < WRONG_PX


@pytest.mark.parametrize(("before", "after"), [(1.0, 2.0), (2.0, 1.0), (1.0, 1.7), (2.0, 2.1)])
def test_saturation_by_another_light_does_not_shift_what_is_seen(before, after, one_core):
    found, off = judged(pair(Camera(gain=before), Camera(gain=after)), one_core)
    assert found.valid.mean() > 0.9
    assert np.sqrt(np.mean(off**2) / 2) < 0.0125  # as without; matched blindly it is 0.02
    assert off.max() < WRONG_PX
    assert set(found.status[~found.valid]) <= {Status.SATURATED, Status.POOR_MATCH}


def test_strong_saturation_fails_with_its_reason(one_core):
    found, off = judged(pair(Camera(gain=3.0)), one_core)
    assert 0.1 < (found.status == Status.SATURATED).mean() < 0.5
    assert any("saturated" in sentence for sentence in found.reasons())
    assert off.max() < WRONG_PX


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        (Camera(), Camera(gain=3.0), "2.% of the picture is saturated, of the reference 0%"),
        (Camera(gain=6.0), Camera(gain=6.0), r"\(..% of it is at grey value 255: photograph in another light\)"),
        (Camera(), Camera(gain=2.0, offset=-160.0), r"picture \(7.% of it is at grey value 0"),
    ],
)
def test_what_cannot_be_matched_for_its_light_says_so(before, after, sentence, one_core):
    with pytest.raises(ConvergenceError, match=sentence):
        judged(pair(before, after), one_core)


def test_a_series_names_the_frame_with_too_much_light():
    good = pair()
    glaring = pair(Camera(), Camera(gain=3.0)).deformed
    with pytest.raises(ConvergenceError, match=r"frame 2 \(2.% of it is at grey value 255"):
        list(track([good.reference, good.deformed, glaring], Settings(threads=1)))


ROWS, COLUMNS = np.indices(SHAPE)
FAULTS = {
    "hot pixels": np.random.default_rng(0).random(SHAPE) < 0.02,
    "white lines": ROWS % 10 == 0,
    "a white bar": (abs(ROWS - 110) < 10) & (abs(COLUMNS - 110) < 80),
    "a white half": COLUMNS > 110,
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_the_sensor_do_not_hold_the_speckle(name, one_core):
    fault = FAULTS[name]
    found, off = judged(spoilt(fault), one_core)
    whole = np.array([fault[r - 12 : r + 13, c - 12 : c + 13].mean() for c, r in found.points.astype(int)])
    assert found.valid[whole < 0.15].mean() > 0.95
    assert not found.valid[whole > 0.7].any()
    assert np.mean(off > WRONG_PX) <= 2e-3
    assert np.sqrt(np.mean(off**2) / 2) < 0.02  # half of the pixels at the worst, and the spline beside the faults


@pytest.mark.parametrize("value", [0, 120])
def test_a_blank_half_fails_and_the_other_is_matched(value, one_core):
    good = pair()
    found, off = judged(replace(good, deformed=np.where(COLUMNS > 110, value, good.deformed)), one_core)
    assert not found.valid[found.points[:, 0] > 110 + 13].any()
    assert found.valid[found.points[:, 0] < 110 - 15].mean() > 0.97
    assert off.max() < WRONG_PX


@pytest.mark.parametrize("gap", [8.0, 0.0, -20.0])
def test_a_gap_may_be_black(gap, one_core):
    cut = Cut((199.5, 160.0), np.pi / 2, (1.0, 0.0), lambda xi: 0.02 * xi)
    seen = photograph_pair(Cracked((cut,)), (400, 400), 1, Camera(gap=gap))
    found = count(correlate(seen.reference, seen.deformed, one_core), seen)
    assert found.valid[0] / found.points[0] >= 0.95  # goal, as for a grey one
    assert np.sqrt(found.square[0] / found.valid[0]) <= 0.03  # goal, px
    assert found.wrong.sum() == 0


def test_pictures_that_are_the_same_have_not_moved(one_core):
    good = pair().reference
    found = correlate(good, good, one_core)
    assert found.valid.all()
    assert np.abs(found.displacement).max() < 1e-6  # the spline in single precision


@pytest.mark.parametrize("scale", [1 / 255, 1e-6, 16.0, 257.0])
def test_the_unit_of_the_grey_values_does_not_matter(scale, one_core):
    good = pair()
    plain = correlate(good.reference, good.deformed, one_core)
    scaled = correlate(good.reference * scale, good.deformed * scale, one_core)
    assert np.array_equal(scaled.valid, plain.valid)
    assert np.allclose(scaled.displacement, plain.displacement, rtol=0, atol=1e-4)  # iterations stop at 1e-3

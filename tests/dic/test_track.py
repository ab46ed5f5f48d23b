"""Series: renewed references, composed back to frame 0."""

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.camera import View
from pipeline.dic.motion import Affine, Cracked, Cut, truth
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Speckle, photograph
from pipeline.dic.track import Tracker, track, tracked_field

SHAPE = (220, 220)
SPECKLE = Speckle.scattered(SHAPE, np.random.default_rng(0))


def pictures(motions):
    for k, motion in enumerate(motions):
        yield photograph(SPECKLE, SHAPE, motion, Camera(), np.random.default_rng(k))


def turning(frames):
    share = np.linspace(0, 1, frames)
    return [Affine.rigid((60 * s, -25 * s), 0.02 * s, (110, 110)) for s in share]


def opening(frames, most=12.0):
    share = np.linspace(0, 1, frames)
    # a rigid shift with the opening: uncomposed, the motion of the renewed reference would be missed
    return [
        Cracked((Cut((110.0, -400.0), np.pi / 2, (most * s, 0.0), np.ones_like),), Affine((4 * s, 0))) for s in share
    ]


@pytest.mark.parametrize(("renew", "limit"), [(0.25, 0.0115), (0.0, 0.025)])
def test_sixty_pixels_and_rotation_are_followed(renew, limit):
    motions = turning(7)
    settings = Settings(threads=1, search_px=40)
    for number, found in enumerate(track(pictures(motions), settings, renew_znssd=renew), start=1):
        off = found.displacement - truth(motions[number], found.points)
        after = found.points + truth(motions[number], found.points)
        inside = np.all((after > 16) & (after < 203), axis=1)
        assert found.valid[inside].mean() > 0.99  # nothing is lost
        assert np.sqrt(np.nanmean(off**2)) < limit  # one match; six renewals add up in squares
        assert np.all(np.abs(np.nanmean(off, axis=0)) < 0.4 * limit)  # no drift: three deviations of 60 subsets


def test_renewed_deviations_grow_as_the_errors_do():
    motions = turning(5)
    found = list(track(pictures(motions), Settings(threads=1, search_px=40), renew_znssd=0.0))
    off = found[-1].displacement - truth(motions[-1], found[-1].points)
    assert np.sqrt(np.nanmean(off**2)) == pytest.approx(
        np.sqrt(np.nanmean(found[-1].std[found[-1].valid] ** 2)), rel=0.2
    )


@pytest.mark.parametrize(("renew", "wrong"), [(0.25, 0.02), (0.0, 0.1)])
def test_a_crack_is_followed_through_renewals(renew, wrong):
    motions = opening(6)
    for number, found in enumerate(track(pictures(motions), Settings(threads=1, search_px=40), renew_znssd=renew), 1):
        off = np.linalg.norm(found.displacement - truth(motions[number], found.points), axis=1)
        near = motions[number].distance(found.points) < 12
        assert found.valid[near].mean() > 0.7  # points within 1 px of the crack cannot be told
        # goal 0.01 of a hundred points; renewing at every frame adds up five errors
        assert np.nanmean(off[near] > 0.1) <= wrong
        assert np.nansum(off[~near] > 0.1) <= 1
    assert found.split.sum() > 50


def test_a_field_in_metres_with_times():
    motions = turning(3)
    field = tracked_field(pictures(motions), np.array([0.0, 0.2, 0.4]), View(1e-4), Settings(threads=1, search_px=60))
    assert field.displacement.shape == (3, len(field.points), 2)
    assert not field.displacement[0].any()
    middle = np.argmin(np.linalg.norm(field.points - [0.011, -0.011], axis=1))
    np.testing.assert_allclose(field.displacement[1, middle], [30e-4, 12.5e-4], atol=2e-5)  # rotation by 0.01 over 6 px


def test_frames_are_named_in_refusals():
    motions = turning(2)
    with pytest.raises(InputError, match="frame 1 has 100 × 220 px"):
        list(track([next(pictures(motions)), np.eye(220)[:, :100]], Settings(threads=1)))
    strange = Speckle.scattered(SHAPE, np.random.default_rng(9))
    other = photograph(strange, SHAPE, Affine(), Camera(), np.random.default_rng(1))
    with pytest.raises(ConvergenceError, match="frame 1"):
        list(track([next(pictures(motions)), other], Settings(threads=1)))
    with pytest.raises(InputError, match="2 frames but 3 times"):
        tracked_field(pictures(motions), np.arange(3.0), View(1e-4), Settings(threads=1, search_px=70))


def test_pictures_are_taken_one_at_a_time():
    taken = []

    def watched():
        for k, picture in enumerate(pictures(turning(4))):
            taken.append(k)
            yield picture

    series = track(watched(), Settings(threads=1, search_px=40, grid_step_px=20))
    next(series)
    assert taken == [0, 1]  # frame 2 is not read before it is asked for


@pytest.mark.parametrize("stop", [2, 4])
def test_a_series_taken_up_again_is_the_same(stop):
    frames = list(pictures(turning(6)))
    settings = Settings(threads=1, search_px=40, grid_step_px=12)
    whole, base, sound = Tracker(frames[0], settings, renew_znssd=0.0), [0], [0.0]
    found = []
    for frame in frames[1:]:
        found.append(whole.follow(frame))
        base.append(whole.base)
        sound.append(whole.sound)
    again, number = Tracker(frames[0], settings, renew_znssd=0.0), base[stop]
    renewed = (number, frames[number], found[number - 1]) if number else None
    again.resume(stop, (frames[stop], found[stop - 1]), found[stop - 2], renewed, sound[stop])
    for frame, expected in zip(frames[stop + 1 :], found[stop:], strict=True):
        result = again.follow(frame)
        np.testing.assert_array_equal(result.warp, expected.warp)
        np.testing.assert_array_equal(result.status, expected.status)
    assert (again.base, again.sound) == (whole.base, whole.sound)

"""The camera's clock, and what is told where it cannot be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import MM
from pipeline.store.bundle import read_bundle
from pipeline.store.new import Contents, first_experiment, write_bundle
from pipeline.study.gauge import Opening, Timing, _arms, _stands, remarks, sentence, synchronised
from pipeline.study.measurement import frames_at_rest

TIME = np.arange(0, 60, 0.2)
CMOD = 8e-6 * np.maximum(TIME - 8, 0)
BEAM = SingleEdgeNotchedBeam(60 * MM, 130 * MM, 137 * MM, 40 * MM, 15 * MM)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bundles") / "b"
    write_bundle(folder, first_experiment("seb", "b"), Contents())
    return replace(read_bundle(folder), curve=LoadCurve(TIME, CMOD, 1 + 0 * TIME))


def given(bundle, offset):
    section = bundle.experiment.dic.model_copy(update={"sync_offset_s": offset})
    return replace(bundle, experiment=bundle.experiment.model_copy(update={"dic": section}))


def seen(stamp, late, gain=1.0, shown=True, noise=1e-6):
    value = gain * np.interp(stamp - late, TIME, CMOD) + np.random.default_rng(0).normal(0, noise, stamp.size)
    return Opening(value, np.full(stamp.size, noise), shown)


STAMP = np.arange(3.0, 50, 1.0)


def test_the_clock_is_estimated_with_its_error(bundle):
    found = synchronised(bundle, STAMP, seen(STAMP, 2.5))
    assert found.how == "estimated"
    assert found.offset == pytest.approx(2.5, abs=5 * found.std)  # five deviations
    assert found.gain == 1.0
    assert sentence(found) == f"camera +{found.offset:.3f} ± {found.std:.3f} s against the record"
    assert remarks(found) == []


def test_out_of_sight_of_the_gauge_gain_and_bending_are_fitted_and_told(bundle):
    load = 900 * np.sin(np.minimum(CMOD / 1.5e-4, np.pi))
    curve = LoadCurve(TIME, CMOD, load)
    carried = seen(STAMP, -1.0, gain=0.97, shown=False)
    carried = replace(carried, value=carried.value - 2e-8 * np.interp(STAMP + 1.0, TIME, load))
    found = synchronised(replace(bundle, curve=curve), STAMP, carried)
    assert found.offset == pytest.approx(-1.0, abs=5 * found.std)  # five deviations
    assert found.gain == pytest.approx(0.97, abs=0.02)
    [told] = remarks(found)
    assert told.startswith("the gauge is not in the images")
    assert "0.97 times the record's CMOD" in told or "0.96" in told or "0.98" in told


@pytest.mark.parametrize("scale", [0.5, 0.8, 1.25])
def test_a_wrong_scale_of_the_camera_is_told(bundle, scale):
    curve = LoadCurve(TIME, 8e-6 * np.maximum(TIME - 8, 0) * (1 + np.maximum(TIME - 25, 0) / 10), 1 + 0 * TIME)
    value = scale * np.interp(STAMP - 1.0, TIME, curve.cmod)
    found = synchronised(replace(bundle, curve=curve), STAMP, Opening(value, np.full(STAMP.size, 1e-6), True))
    [told] = remarks(found)
    assert told.startswith(f"the images show {scale:.2f} times the CMOD of the record")


def test_a_wrong_scale_is_told_beside_a_clock_that_was_given(bundle):
    curve = LoadCurve(TIME, 8e-6 * np.maximum(TIME - 8, 0), 1 + 0 * TIME)
    bent = given(replace(bundle, curve=curve), 1.0)
    told = [
        remarks(synchronised(bent, STAMP, Opening(scale * np.interp(STAMP - 1.0, TIME, curve.cmod), noise, True)))
        for scale, noise in ((0.5, np.full(STAMP.size, 1e-6)), (1.0, np.full(STAMP.size, 1e-6)))
    ]
    assert told[0][0].startswith("the images show 0.50 times the CMOD of the record")
    assert told[1] == []


def test_a_clock_that_is_not_known_to_an_image_is_told(bundle):
    [told] = remarks(synchronised(bundle, STAMP, seen(STAMP, 2.5, noise=1e-4)))  # 12 s of the motion's rate
    assert "the order of the images" in told


def test_an_offset_that_was_given_is_taken(bundle):
    found = synchronised(given(bundle, 2.0), STAMP, seen(STAMP, 2.5))
    assert (found.offset, found.std, found.how) == (2.0, None, "given")
    assert found.rms < 8e-6  # what half a second makes of the rate
    assert synchronised(given(bundle, 2.0), STAMP, None).offset == 2.0


def test_without_a_record_the_camera_keeps_its_time(bundle):
    found = synchronised(replace(bundle, curve=None), STAMP, seen(STAMP, 2.5))
    assert (found.offset, found.std, found.how) == (0.0, None, "no record")
    assert "no load record" in sentence(found)


def test_what_cannot_be_synchronised_says_what_to_do(bundle):
    with pytest.raises(InputError, match="give \\[dic\\] sync_offset_s"):
        synchronised(bundle, STAMP, None)
    value = 8e-6 * STAMP + np.random.default_rng(0).normal(0, 1e-7, STAMP.size)
    ramp = Opening(value, np.full(STAMP.size, 1e-7), True)
    moving = replace(bundle, curve=LoadCurve(TIME, 8e-6 * TIME, 1 + 0 * TIME))
    with pytest.raises((InputError, ConvergenceError), match=r"load_cmod.csv: .*; or give \[dic\] sync_offset_s"):
        synchronised(moving, STAMP[20:30], replace(ramp, value=ramp.value[20:30], std=ramp.std[20:30]))
    assert remarks(Timing(0.0, None, "no record")) == [
        "the images do not show enough of both flanks of the notch: the opening was not measured"
    ]


@pytest.mark.parametrize(("low", "shown", "arms"), [(0.5, True, True), (5.0, False, True), (13.0, False, False)])
def test_the_gauge_stands_where_there_are_points_else_the_arms_carry_it(low, shown, arms):
    x, y = np.meshgrid(np.arange(-10, 10.1, 0.25), np.arange(low, 30, 0.25))
    points = np.column_stack([x.ravel(), y.ravel()]) * MM
    assert _stands(points, np.array([2 * MM, 0.0]), 2 * MM) == shown
    found = _arms(points, np.ones(len(points), bool), BEAM, 1.0 * MM)
    assert (found is not None) == arms
    if found is not None:
        for arm, side in zip(found, (-1, 1), strict=True):
            assert np.all(np.sign(points[arm, 0]) == side)
            assert points[arm, 1].max() < BEAM.tip[1]
            assert len(np.unique(np.floor(points[arm] / MM), axis=0)) == arm.sum()  # one a subset


@pytest.mark.parametrize(
    ("ratio", "count"),
    [([1.0, 1.03, 0.98, 1.2, 3.0], 3), ([2.0, 2.1, 2.05, 2.6], 3), ([1.4, 2.0, 3.0], 1), ([5.0, 9.0], 0), ([1.0], 1)],
)
def test_frames_at_rest_end_where_the_scatter_grows(ratio, count):
    assert frames_at_rest(np.array(ratio)) == count

"""Figures of the correlation: lines and colours are the data, where the picture shows them."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.frames import COLUMN, OPENING, SCALE, cracked_result, straight_crack
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import CenteredNorm
from matplotlib.figure import Figure

from pipeline.core.curve import LoadCurve
from pipeline.report.correlation import (
    Sight,
    clocks,
    component_map,
    contact_panel,
    crack_overlay,
    cuts,
    misfit_map,
    moved_tip,
    opening_profile,
    quality_map,
    without_rigid,
)
from pipeline.report.photograph import photograph_axes, scale_bar, stretched
from pipeline.report.style import png

PICTURE = np.random.default_rng(0).integers(0, 255, (210, 205)).astype(float)


def sight(crack=True, **how) -> Sight:
    return Sight(cracked_result(), straight_crack(**how) if crack else None, SCALE, "CMOD 0.1 mm")


def test_cuts_lie_in_the_middle_of_the_gap_of_the_deformed_picture():
    pieces, opening = cuts(cracked_result())
    result = cracked_result()
    assert len(pieces) == np.count_nonzero(result.split)
    np.testing.assert_allclose(pieces[..., 0], COLUMN, atol=1e-9)  # halves move apart by as much either way
    np.testing.assert_allclose(np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1), 6)  # one grid step long
    np.testing.assert_allclose(opening, OPENING)


def test_cuts_that_hardly_open_are_not_drawn():
    assert len(cuts(cracked_result(opening=0.05))[0]) == 0  # 0.02 px of deviation, three of them


def test_the_overlay_is_coloured_by_the_opening():
    axes = Figure().subplots()
    crack_overlay(axes, PICTURE, sight())
    lines = [c for c in axes.collections if isinstance(c, LineCollection) and c.get_array() is not None]
    np.testing.assert_allclose(lines[0].get_array(), OPENING * SCALE * 1e6)  # µm


def test_the_tip_goes_with_the_material():
    crack = straight_crack()
    moved = moved_tip(cracked_result(), crack)
    assert abs(abs(moved[0] - crack.tip[0]) - OPENING / 2) < 1e-9
    assert moved[1] - crack.tip[1] == pytest.approx(-0.25)


def test_maps_leave_failed_points_bare():
    result, axes = cracked_result(), Figure().subplots()
    values = np.where(result.valid, result.warp[:, 0], np.nan)
    component_map(axes, PICTURE, sight(), values, "u (px)")
    [mesh] = [c for c in axes.collections if isinstance(c, QuadMesh)]
    shown = mesh.get_array()
    assert np.ma.count_masked(shown) == np.count_nonzero(~result.valid) > 0
    assert isinstance(mesh.norm, CenteredNorm)
    corner = mesh.get_coordinates()[0, 0]
    np.testing.assert_allclose(corner, [12, 12])  # half a step before the first node


def test_the_legend_counts_every_point():
    axes = Figure().subplots()
    quality_map(axes, PICTURE, sight())
    told = {text.get_text() for text in axes.get_legend().get_texts()}
    result = cracked_result()
    failed = np.count_nonzero(~result.valid)
    assert told == {
        f"ok: {np.count_nonzero(result.status == 0)}",
        f"split: {np.count_nonzero(result.split)}",
        f"on crack: {failed}",
    }


def test_the_profile_is_in_millimetres_and_micrometres():
    axes = Figure().subplots()
    opening_profile(axes, [sight(), sight(crack=False)])
    line = axes.lines[0]
    np.testing.assert_allclose(line.get_xdata(), straight_crack().arc * SCALE * 1e3)
    np.testing.assert_allclose(line.get_ydata(), straight_crack().opening * SCALE * 1e6)
    band = axes.collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx((OPENING + 2 * 0.02) * SCALE * 1e6)  # two deviations
    assert len(axes.get_legend().get_texts()) == 1  # the frame without a crack is not among them


def test_rigid_motion_is_taken_out():
    left = without_rigid(cracked_result())
    assert np.isnan(left[~cracked_result().valid]).all()
    np.testing.assert_allclose(np.nanmean(left, axis=0), 0, atol=1e-12)  # round-off


def test_both_clocks_are_shown():
    time = np.arange(0, 10.0)
    record = LoadCurve(time, 1e-5 * time, np.ones(10))
    axes = Figure().subplots()
    clocks(axes, record, time + 2.0, 2.0, 2e-5 * time + 1e-6, 2.0, 1e-6)
    own, shifted = axes.lines[1], axes.lines[2]
    np.testing.assert_allclose(own.get_xdata(), time + 2)
    np.testing.assert_allclose(shifted.get_xdata(), time)
    np.testing.assert_allclose(shifted.get_ydata(), record.cmod * 1e3, atol=1e-12)


def test_a_photograph_is_stretched_and_has_a_scale_bar():
    axes = Figure().subplots()
    photograph_axes(axes, PICTURE, SCALE)
    assert axes.get_ylim() == (209.5, -0.5)  # rows downwards
    assert (stretched(PICTURE).min(), stretched(PICTURE).max()) == (0, 1)
    bar = axes.lines[-1].get_xdata()
    assert (bar[1] - bar[0]) * 205 * SCALE * 1e3 == pytest.approx(2.0)  # mm: a fifth of 10.25 mm, rounded down
    scale_bar(axes, 1e-6, 205)
    assert axes.texts[-1].get_text() == "0.02 mm"


def test_all_can_be_rendered():
    norm = CenteredNorm(0.0, 100.0)
    assert png(
        lambda a: crack_overlay(a, PICTURE, sight(crack=False)),
        lambda a: misfit_map(a, PICTURE, sight()),
        lambda a: contact_panel(a, sight(through=True), norm, PICTURE),
        lambda a: opening_profile(a, []),
        columns=2,
    )

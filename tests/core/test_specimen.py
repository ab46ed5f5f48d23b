"""Specimens: areas in closed form, symmetry, refusals that name the rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam, crosses_notch, ligament_area
from pipeline.core.units import MM

BEAM = SingleEdgeNotchedBeam(depth=60 * MM, span=130 * MM, length=137 * MM, thickness=40 * MM, notch_length=15 * MM)
DISK = DiskCompactTension(
    diameter=150 * MM, width=110 * MM, edge_to_load_line=35 * MM, thickness=50 * MM, notch_length=27.5 * MM
)
WIDE = (replace(BEAM, notch_width=3 * MM), replace(DISK, notch_width=3 * MM))


def area_of(specimen, pitch: float = 0.1 * MM) -> float:
    x0, y0, x1, y1 = specimen.bounds
    x, y = np.arange(x0 + pitch / 2, x1, pitch), np.arange(y0 + pitch / 2, y1, pitch)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return specimen.contains(grid).sum() * pitch**2


def notch_area(length: float, width: float) -> float:
    """A slot ending in a half circle."""
    return width * (length - width / 2) + np.pi * width**2 / 8


def beam_area(beam: SingleEdgeNotchedBeam) -> float:
    return beam.length * beam.depth - notch_area(beam.notch_length, beam.notch_width)


def disk_area(disk: DiskCompactTension) -> float:
    radius, above = disk.diameter / 2, disk.centre_y  # the mouth cuts off the segment below y = 0
    half = np.arccos(above / radius)
    segment = radius**2 * half - above * np.sqrt(radius**2 - above**2)
    holes = 2 * np.pi * (disk.pin_diameter / 2) ** 2
    return np.pi * radius**2 - segment - holes - notch_area(disk.tip[1], disk.notch_width)


@pytest.mark.parametrize(
    ("specimen", "area"), [(s, beam_area) for s in (BEAM, WIDE[0])] + [(s, disk_area) for s in (DISK, WIDE[1])]
)
def test_material_area_in_closed_form(specimen, area):
    # pixels of 0.1 mm: rim of about 600 mm, random rounding of 1/√12 pixel each leaves 1e-5; 2e-4 also holds for rows
    # of pixels that lie along a straight edge
    assert area_of(specimen) == pytest.approx(area(specimen), rel=2e-4)


def shoelace(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


@pytest.mark.parametrize(("specimen", "area"), [(WIDE[0], beam_area), (WIDE[1], disk_area)])
def test_outline_encloses_the_same_area(specimen, area):
    body, *cuts = specimen.outline()
    assert shoelace(body) - sum(map(shoelace, cuts)) == pytest.approx(
        area(specimen), rel=2e-4
    )  # circles of 360 chords: 5e-5


@pytest.mark.parametrize("specimen", [BEAM, DISK, *WIDE])
def test_left_and_right_are_alike(specimen):
    points = np.random.default_rng(0).uniform(*np.reshape(specimen.bounds, (2, 2)), size=(4000, 2))
    mirrored = points * (-1, 1)
    for question in (specimen.contains, specimen.protected):
        np.testing.assert_array_equal(question(points), question(mirrored))


@pytest.mark.parametrize("specimen", [BEAM, DISK])
def test_ligament(specimen):
    assert specimen.tip[1] + specimen.ligament_length == pytest.approx(specimen.bounds[3], rel=1e-14)  # round-off
    assert ligament_area(specimen) == specimen.ligament_length * specimen.thickness


def test_paper_ligaments():
    assert BEAM.ligament_length == pytest.approx(45 * MM, rel=1e-12)  # stated in the paper
    assert DISK.ligament_length == pytest.approx(82.5 * MM, rel=1e-12)  # ASTM D7313


@given(
    x=st.floats(-5, 5).map(lambda v: v * MM),
    y=st.floats(0, 60).map(lambda v: v * MM),
    angle=st.floats(-np.pi, np.pi),
    length=st.floats(0.01, 5).map(lambda v: v * MM),
)
def test_crossing_is_the_same_from_both_ends(x, y, angle, length):
    start = np.array([[x, y]])
    end = start + length * np.array([[np.cos(angle), np.sin(angle)]])
    assert crosses_notch(BEAM, start, end) == crosses_notch(BEAM, end, start)


def test_crossing_at_mouth_tip_and_ligament():
    left, right = np.full(4, -1 * MM), np.full(4, 1 * MM)
    start = np.column_stack([left, [5 * MM, 14 * MM, 14 * MM, 20 * MM]])
    end = np.column_stack([right, [5 * MM, 15.9 * MM, 16.1 * MM, 20 * MM]])
    np.testing.assert_array_equal(crosses_notch(BEAM, start, end), [True, True, False, False])
    assert not crosses_notch(BEAM, start, start).any()
    on_line = np.array([[0.0, 5 * MM]])
    assert crosses_notch(BEAM, on_line, start[:1]).item()  # a point on the line counts as right of it
    assert not crosses_notch(BEAM, on_line, end[:1]).item()


def test_beam_grips_are_half_disks_at_the_rollers():
    at = np.random.default_rng(1).uniform(*np.reshape(BEAM.bounds, (2, 2)), size=(200_000, 2))
    at = at[BEAM.contains(at)]
    share = 137 * 60 / 200_000  # mm² a point
    for region in BEAM.grip_regions(0.3 * MM):
        held = at[region.contains(at)]
        assert len(held) * share == pytest.approx(np.pi * 2**2 / 2, rel=0.25)  # 150 points: 3 σ of counting
        assert np.hypot(*(held - region.centre).T).max() <= BEAM.contact
    assert {r.name: (r.role, r.drive) for r in BEAM.grip_regions(0.3 * MM)} == {
        "platen": ("drive", 1.0),
        "left": ("react", 0.0),
        "right": ("react", 0.0),
        "centre": ("guide", 0.0),
    }


def test_pins_press_on_the_outer_rim_of_their_holes():
    right, left, *_ = DISK.grip_regions(0.3 * MM)
    for region, side in ((right, 1), (left, -1)):
        centre = np.array([side * 25 * MM, 35 * MM])
        turn = np.radians([0, 29, 31, 180])
        rim = centre + 13 * MM * np.column_stack([side * np.cos(turn), np.sin(turn)])
        np.testing.assert_array_equal(region.contains(rim), [True, True, False, False])
        assert region.direction == (side, 0.0)
    assert (right.drive, left.drive) == (1.0, 0.0)


def test_grips_are_never_thinner_than_a_particle_row():
    coarse = 2 * MM
    assert BEAM.grip_regions(coarse)[0].outer == pytest.approx(2.5 * coarse)
    assert DISK.grip_regions(coarse)[0].outer - DISK.pin_diameter / 2 == pytest.approx(2.5 * coarse)


def test_protected_distances():
    assert BEAM.protected(
        np.array([[0, 56.1 * MM], [0, 55.9 * MM], [65 * MM, 3.9 * MM], [65 * MM, 4.1 * MM]])
    ).tolist() == [
        True,
        False,
        True,
        False,
    ]
    assert DISK.protected(np.array([[25 * MM, 53.4 * MM], [25 * MM, 53.6 * MM]])).tolist() == [True, False]


@pytest.mark.parametrize(
    ("specimen", "change", "says"),
    [
        (BEAM, {"thickness": -40 * MM}, "thickness_mm = -40 must be positive"),
        (BEAM, {"notch_length": 60 * MM}, "notch_length_mm = 60 reaches outside .* depth_mm = 60"),
        (BEAM, {"notch_length": 0.0}, "notch_length_mm = 0 must be positive"),
        (BEAM, {"length": 120 * MM}, "length_mm = 120 must not be smaller than span_mm = 130"),
        (BEAM, {"notch_width": 5 * MM}, "gauge_length_mm = 4 must not be smaller than notch_width_mm = 5"),
        (BEAM, {"notch_width": -1 * MM}, "notch_width_mm = -1 must not be negative"),
        (DISK, {"notch_length": 110 * MM}, "notch_length_mm = 110 reaches outside"),
        (DISK, {"width": 120 * MM}, "must not exceed diameter_mm = 150"),
        (DISK, {"pin_spacing": 20 * MM}, "pin_spacing_mm = 20 must be larger than pin_diameter_mm"),
        (DISK, {"pin_spacing": 120 * MM}, "pin holes .* reach outside the disk"),
        (DISK, {"diameter": float("nan")}, "diameter_mm = nan must be positive"),
    ],
)
def test_refusals_name_key_value_and_rule(specimen, change, says):
    with pytest.raises(InputError, match=says):
        replace(specimen, **change)


def test_all_faults_are_told_at_once():
    with pytest.raises(InputError, match=r"depth_mm = -1 .*; .*span_mm = 0 "):
        SingleEdgeNotchedBeam(depth=-1 * MM, span=0.0, length=1 * MM, thickness=1 * MM, notch_length=-3 * MM)

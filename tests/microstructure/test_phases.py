"""Phases of particles and bonds, and what is taken away."""

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phase_map import PhaseMap
from pipeline.microstructure.phases import lay_phases
from pipeline.microstructure.placement import ImagePlacement

MM = 1e-3
PLACEMENT = ImagePlacement(0.25 * MM, (300.0, 260.0))  # 75 mm on each side of the notch line, the mouth near the bottom
SHAPE = (280, 601)


def paint(*boxes):
    """Mastic with boxes (x0, x1, y0, y1 in mm, phase, stone) over it."""
    row, column = np.indices(SHAPE)
    x, y = PLACEMENT.to_specimen(np.column_stack([column.ravel(), row.ravel()])).T / MM
    label, stone = np.full(SHAPE, Phase.MASTIC, np.uint8), np.zeros(SHAPE, np.int32)
    for x0, x1, y0, y1, phase, number in boxes:
        box = ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).reshape(SHAPE)
        label[box], stone[box] = phase, number
    return PhaseMap(label, stone, PLACEMENT)


@pytest.fixture(scope="module")
def packing(beam):
    return hexagonal_packing(beam, 0.6 * MM, np.pi / 2)


def test_without_an_image_all_is_mastic_and_nothing_is_lost(beam, packing):
    particles, bonds, report = lay_phases(beam, packing)
    assert np.array_equal(particles.position, packing.position)
    assert np.array_equal(bonds.pairs, packing.pairs)
    assert report.bonds_by_phase == ((Phase.MASTIC, len(packing.pairs)),)
    assert (report.outside, report.void, report.islands, report.loose, report.stones) == (0, 0, 0, 0, 0)


@pytest.mark.parametrize("angle", [0, 11, 30, 45, 90])
def test_smooth_outlines_leave_next_to_nothing_loose(beam, disk, angle):
    for specimen in (beam, disk):
        _, _, report = lay_phases(specimen, hexagonal_packing(specimen, 0.6 * MM, np.deg2rad(angle)))
        assert report.islands + report.loose <= 4  # at most the sharp corners of the outline


def test_bonds_take_the_phases_of_their_particles(beam, packing):
    image = paint((10, 30, 20, 40, Phase.AGGREGATE, 1), (30.01, 50, 20, 40, Phase.AGGREGATE, 2))
    particles, bonds, report = lay_phases(beam, packing, image)
    x, y = particles.position.T / MM
    safe = (np.abs(x - 10) > 0.2) & (np.abs(x - 50) > 0.2) & (np.abs(y - 20) > 0.2) & (np.abs(y - 40) > 0.2)
    inside = (x > 10) & (x < 50) & (y > 20) & (y < 40)
    assert np.array_equal((particles.phase == Phase.AGGREGATE)[safe], inside[safe])
    a, b = bonds.pairs.T
    aggregate = particles.phase == Phase.AGGREGATE
    expected = np.select(
        [aggregate[a] != aggregate[b], ~aggregate[a], particles.stone[a] == particles.stone[b]],
        [Phase.INTERFACE, Phase.MASTIC, Phase.AGGREGATE],
        Phase.TOUCHING,
    )
    assert np.array_equal(bonds.phase, expected)
    # rows of 90°: of the bonds between two columns two leave each particle; 20 mm of column hold 20/1.2 particles
    assert dict(report.bonds_by_phase)[Phase.TOUCHING] == pytest.approx(2 * 20 / 1.2, abs=2)
    assert sum(n for _, n in report.bonds_by_phase) == bonds.count == report.bonds
    assert report.stones == 2
    assert report.aggregate_fraction == pytest.approx(40 * 20 / (60 * 137), rel=0.02)  # a row more or less on 20 mm


def test_only_bonds_near_the_rollers_are_protected(beam, packing):
    particles, bonds, _ = lay_phases(beam, packing)
    middle = particles.position[bonds.pairs].mean(axis=1)
    near = np.min([np.hypot(*(middle - c).T) for c in ((0, 0.06), (-0.065, 0), (0.065, 0))], axis=0)
    assert np.array_equal(bonds.protected, near <= 4 * MM)


def test_voids_and_what_they_cut_off_are_counted(beam, packing):
    frame = [(20, 40, 20, 24), (20, 40, 36, 40), (20, 24, 20, 40), (36, 40, 20, 40)]
    particles, bonds, report = lay_phases(beam, packing, paint(*[(*box, Phase.VOID, 0) for box in frame]))
    x, y = particles.position.T / MM
    assert not ((x > 20.2) & (x < 39.8) & (y > 20.2) & (y < 39.8)).any()  # the block within the frame is an island
    assert report.islands == pytest.approx(12 * 12 / (2 * 3**0.5 * 0.36), rel=0.08)  # one row on 12 mm
    assert report.void == pytest.approx((20 * 20 - 12 * 12) / (2 * 3**0.5 * 0.36), rel=0.08)
    assert report.places == report.void + report.islands + report.loose + report.particles == len(packing.position)
    assert particles.count == report.particles
    assert bonds.pairs.max() == particles.count - 1
    assert np.hypot(
        *(particles.position[bonds.pairs[:, 1]] - particles.position[bonds.pairs[:, 0]]).T
    ) == pytest.approx(1.2 * MM, rel=1e-12)


def test_every_particle_left_has_bonds_in_two_directions(beam, packing):
    rng = np.random.default_rng(0)
    image = paint()
    holes = np.where(rng.random(SHAPE) < 0.12, np.uint8(Phase.VOID), image.label)
    particles, bonds, report = lay_phases(beam, packing, PhaseMap(holes, image.stone, PLACEMENT))
    assert report.void > 0.1 * report.places
    assert report.loose > 0
    arm = particles.position[bonds.pairs[:, 1]] - particles.position[bonds.pairs[:, 0]]
    turn = np.rint(np.arctan2(arm[:, 1], arm[:, 0]) % np.pi / (np.pi / 3) - 0.5).astype(int) % 3
    directions = np.zeros((particles.count, 3), bool)
    for side in (0, 1):
        directions[bonds.pairs[:, side], turn] = True
    assert directions.sum(axis=1).min() >= 2


def test_an_image_that_misses_the_specimen_is_refused(beam, packing):
    image = paint()
    shifted = PhaseMap(
        image.label, image.stone, ImagePlacement(0.25 * MM, (280.0, 260.0))
    )  # 1.5 mm of 137 beyond the edge
    assert lay_phases(beam, packing, PhaseMap(image.label, image.stone, ImagePlacement(0.25 * MM, (273.0, 260.0))))
    assert lay_phases(beam, packing, shifted)[2].outside == 0
    far = PhaseMap(image.label, image.stone, ImagePlacement(0.25 * MM, (150.0, 260.0)))  # 31 mm of 137
    with pytest.raises(InputError, match=r"2[23]% of the specimen lies outside its image.*at most 2%"):
        lay_phases(beam, packing, far)


def test_a_specimen_cut_apart_by_voids_is_refused(beam, packing):
    with pytest.raises(InputError, match="do not hold to the main part"):
        lay_phases(beam, packing, paint((20, 23, -5, 70, Phase.VOID, 0)))

"""Which side of a boundary is convex: disks, their complement, graded sections however full."""

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.microstructure.convexity import AggregateIs, choose_aggregate, convex_lead
from pipeline.microstructure.gradation import Grading, fuller_section

ALL = np.ones((200, 300), bool)
ROW, COLUMN = np.indices(ALL.shape)
DISK = np.hypot(ROW - 100, COLUMN - 150) < 50


def test_a_disk_is_convex_and_its_complement_is_not():
    assert convex_lead(DISK, ALL, 4) > 0.8  # but for pixels where the raster is flat
    assert convex_lead(~DISK, ALL, 4) == pytest.approx(-convex_lead(DISK, ALL, 4), abs=1e-6)  # single precision


def test_a_straight_boundary_is_neither():
    assert convex_lead(COLUMN < 150, ALL, 4) == 0


def test_an_edge_of_the_specimen_is_no_boundary():
    assert convex_lead(DISK, DISK, 4) == 0


@pytest.mark.parametrize("fraction", [0.2, 0.45, 0.65])
def test_stones_are_found_however_full_the_section(fraction):
    section = fuller_section(0.08, 0.04, 1e-4, np.random.default_rng(0), Grading(fraction, gap=0.0))
    stone, solid = section.stone > 0, np.ones(section.stone.shape, bool)
    for dark, expected in ((stone, AggregateIs.DARK), (~stone, AggregateIs.BRIGHT)):
        choice, lead = choose_aggregate(dark, solid, AggregateIs.AUTO, 23.6)
        assert choice == expected
        assert lead > 0.15  # measured 0.24 (0.65) to 0.64; 0.05 is asked for


def test_an_open_question_is_refused_and_an_answered_one_is_not():
    with pytest.raises(InputError, match="aggregate_is"):
        choose_aggregate(COLUMN < 150, ALL, AggregateIs.AUTO, 20)
    assert choose_aggregate(COLUMN < 150, ALL, AggregateIs.BRIGHT, 20)[0] == AggregateIs.BRIGHT

"""The paper's two tests side by side: readings, differences and where the paper's would be met."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.study.paper_table import (
    ENERGY_DIFFERENCE,
    LOAD_DIFFERENCE,
    Reading,
    Row,
    Unknowns,
    paper_rows,
    paper_table,
    spans_that_match,
)


def row(span, load, energy):
    """A row whose medians differ by load (N) and energy (J/m²)."""
    dct = Reading(3000.0, 0.1, 200.0, True)
    return Row(Unknowns(span_mm=span), (replace(dct, peak=3000.0 + load, energy=200.0 + energy),), (dct,))


def test_a_triangle_is_read_to_the_end_of_the_standard():
    """P falls in a straight line from 1 kN at 0.1 mm to zero at 1.1 mm: 0.1 kN is reached at 1 mm."""
    cmod = np.linspace(0, 1.1e-3, 1101)
    load = np.where(cmod < 1e-4, cmod / 1e-4, (1.1e-3 - cmod) / 1e-3) * 1e3
    found = Reading.of(LoadCurve(cmod, cmod, load), 2e-3)
    assert found.peak == pytest.approx(1000, rel=1e-3)  # a parabola through the tip of a triangle
    assert found.energy == pytest.approx((0.5 * 0.1 + 0.5 * 1.1 * 0.9) / 2e-3, rel=1e-6)
    assert found.ended


def test_the_span_of_each_difference_is_found_between_rows():
    rows = [row(90, LOAD_DIFFERENCE + 500, 100), row(110, LOAD_DIFFERENCE - 500, 120), row(130, -1000, 140)]
    told = spans_that_match(rows)
    assert "the load's difference is met at a span of 100 mm" in told
    assert "the energy's at no span from 90 to 130 mm" in told
    assert ENERGY_DIFFERENCE > 140


def test_both_tests_are_simulated_once_and_kept(tmp_path):
    unknowns = [Unknowns(span_mm=110.0), Unknowns(span_mm=92.0)]
    two = paper_rows(tmp_path, unknowns, [1, 2], radius_mm=2.0, engine="equilibrium", workers=1)
    assert len(list((tmp_path / "simulations").glob("*.h5"))) == 6  # DC(T) has no span
    assert all(row.seb[0] != row.seb[1] and row.dct[0] != row.dct[1] for row in two)
    [long, short] = two
    assert short.seb[0].peak / long.seb[0].peak == pytest.approx(110 / 92, rel=0.05)  # the moment decides
    assert short.dct == long.dct
    again = paper_rows(tmp_path, unknowns, [1, 2], radius_mm=2.0, engine="equilibrium", workers=1)
    assert again == [long, short]
    assert "110 mm" in paper_table(again)

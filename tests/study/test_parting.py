"""From material to bond: cuts counted on a lattice against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.study.parting import expected, part, parting_table


@pytest.mark.parametrize("degrees", [0, 5, 10, 20, 30, 45, 60])
def test_cuts_carry_what_the_closed_forms_say(degrees: float) -> None:
    angle = np.deg2rad(degrees)
    found, formula = part(angle), expected(angle % (np.pi / 3) if degrees != 60 else 0.0)
    nearest = min(degrees % 60, 60 - degrees % 60)
    # bonds at the ends of 582 radii of crack: one in some 600
    assert found.bonds == pytest.approx(formula.bonds, rel=3e-3)
    # bonds nearly along the crack reach f_max late: δ_max is 600 δ_peak, and one at 5° opens 11 times less
    assert found.strength == pytest.approx(np.sqrt(3), rel=0.02)
    energy = np.cos(np.pi / 6 - np.deg2rad(nearest)) / np.cos(np.pi / 6)
    assert found.energy == pytest.approx(energy, rel=3e-3)  # as of the bonds


def test_rows_along_the_crack_end_at_twice_energy_over_strength() -> None:
    """w_c = 2 G_f/f_t: the traction falls along one straight line; exactly √3 in strength."""
    found = part(0.0)
    assert found.last_opening == pytest.approx(2 * found.energy / found.strength, rel=1e-3)  # steps of the opening
    assert found.last_opening == pytest.approx(2 / np.sqrt(3), rel=1e-3)
    assert found.bonds == pytest.approx(2, rel=1e-4)  # 291 of 290.985 periods


def test_rows_across_the_crack_end_later() -> None:
    """Oblique bonds live to 2 δ_max; 4/√3 bonds are cut."""
    found = part(np.pi / 6)
    assert found.last_opening == pytest.approx(2, rel=1e-3)  # steps of the opening
    assert found.bonds == pytest.approx(4 / np.sqrt(3), rel=1e-9)  # whole periods
    assert found.energy == pytest.approx(2 / np.sqrt(3), rel=1e-6)  # trapezoids


def test_the_table_has_both() -> None:
    assert "| 30° | 2.3094 (2.3094) |" in parting_table((30,))

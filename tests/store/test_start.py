"""f_max and delta_max at the start: the paper's numbers, the lattice's own count, and who wins."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.store.bundle import read_bundle
from pipeline.store.start import angle_factor, lattice_parameters, start_parameters

MEASURED = '[material]\ntensile_strength_mpa = 4.0\nfracture_energy_j_per_m2 = 228.0\nconversion = "contact-area"'


@pytest.fixture
def start_of(bundle_folder, toml):
    def read(text: str, radius: float | None = None):
        (bundle_folder / "experiment.toml").write_text(text)
        return start_parameters(read_bundle(bundle_folder), radius)

    return read


def without_start(toml: str) -> str:
    return toml.split("[start]")[0]


def test_the_paper_starts_at_71_newtons(start_of, toml):
    """4.0 MPa and 228 J/m² at r = 0.3 mm, t = 40 mm give 71 N and 1.14e-4 m (physics.md, sect. 2)."""
    f_max, delta_max = start_of(without_start(toml).replace("[material]", MEASURED))
    assert f_max == pytest.approx(71.04, rel=1e-12)  # 0.74 · 4 MPa · 24 mm², exact but for rounding
    assert delta_max == pytest.approx(1.14e-4, rel=1e-12)  # 2 · 228/4e6, exact but for rounding


def test_what_stands_in_start_wins(start_of, toml):
    assert start_of(toml.replace("[material]", MEASURED)) == (71.0, 1.14e-4)


def test_another_radius_keeps_the_traction(start_of, toml):
    """f_max/(2 r t) is kept, delta_max does not depend on r (physics.md, sect. 2)."""
    assert start_of(toml, 6e-4) == pytest.approx((142.0, 1.14e-4), rel=1e-12)  # rounding
    measured = without_start(toml).replace("[material]", MEASURED)
    f_max, delta_max = start_of(measured, 6e-4)
    assert (f_max, delta_max) == pytest.approx((2 * 71.04, 1.14e-4), rel=1e-12)  # rounding


def test_neither_is_refused(start_of, toml):
    with pytest.raises(InputError, match=r"neither \[start\] nor both"):
        start_of(without_start(toml))
    with pytest.raises(InputError, match="add one of the two"):
        start_of(without_start(toml).replace("[material]", "[material]\ntensile_strength_mpa = 4.0"))


@pytest.mark.parametrize(("angle", "factor"), [(90, np.sqrt(3)), (30, np.sqrt(3)), (0, 1.5), (60, 1.5), (-120, 1.5)])
def test_rows_along_and_across_the_crack(angle, factor):
    """delta_max = √3 G/f_t with rows along the crack, 1.5 G/f_t across it; f_max the same."""
    strength, energy, area = 3.9e6, 143.2, 6e-4 * 0.05
    f_max, delta_max = lattice_parameters(strength, energy, area, np.deg2rad(angle))
    assert f_max == pytest.approx(area * strength / np.sqrt(3), rel=1e-12)  # closed form
    assert delta_max == pytest.approx(factor * energy / strength, rel=1e-12)  # closed form


@pytest.mark.parametrize("angle", np.linspace(0, 60, 9))
def test_strength_and_energy_by_counting_cut_bonds(angle):
    """A long straight cut through a lattice: every bond it cuts bears f_max, and opens by w·n.

    Strength Σ f_max |n·d|/(L t), energy Σ ½ f_max δ_max |…|: a bond opens by w |n·d| and is then spent at
    w = δ_max/|n·d|, having taken ½ f_max δ_max whatever its direction.
    """
    r, t, strength, energy = 0.5, 0.04, 4e6, 200.0
    f_max, delta_max = lattice_parameters(strength, energy, 2 * r * t, np.deg2rad(angle))
    length = 4000 * r
    turn = np.deg2rad(angle) + np.array([0, np.pi / 3, 2 * np.pi / 3])
    directions = np.column_stack([np.cos(turn), np.sin(turn)])
    # bonds of one direction: origins on the lattice of area 2√3 r², cut by the line x = 0 where |d_x| 2r reaches
    count = length * np.abs(directions[:, 0]) * 2 * r / (2 * np.sqrt(3) * r**2)
    stress = np.sum(count * f_max * np.abs(directions[:, 0])) / (length * t)
    spent = np.sum(count) * 0.5 * f_max * delta_max / (length * t)
    assert stress == pytest.approx(strength, rel=1e-12)  # closed form
    assert spent == pytest.approx(energy, rel=1e-12)  # closed form


def test_the_factor_lies_between_1_and_two_over_root_3():
    factors = [angle_factor(a) for a in np.linspace(-4, 4, 200)]
    assert min(factors) >= 1 - 1e-12  # round-off
    assert max(factors) <= 2 / np.sqrt(3) + 1e-12  # round-off

"""Opening and sliding together: pure modes, mixed modes, changing directions, friction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.mixed_softening import MixedSoftening, MixedState
from pipeline.materials.softening import LINEAR, Shape, Softening, Unloading

KN, KS, FN, FT, DN, DT = 4.0e8, 1.0e8, 80.0, 50.0, 1.0e-6, 2.0e-6
SHAPES = [LINEAR, Softening(Shape.EXPONENTIAL), Softening(Shape.BILINEAR_TAIL)]
options = st.tuples(st.sampled_from(SHAPES), st.sampled_from(Unloading))


def bond(shape: Softening = LINEAR, unloading: str = "secant", friction: float = 0.0) -> MixedSoftening:
    return MixedSoftening(
        *(np.array([v]) for v in (KN, KS, FN, FT, DN, DT)), softening=shape, unloading=unloading, friction=friction
    )


def follow(law: MixedSoftening, path: np.ndarray) -> tuple[np.ndarray, MixedState, np.ndarray]:
    """Forces (steps, 2), the last state, and stored and used-up energy (steps, 2) along a path (steps, 2)."""
    state, forces, energies = law.at_rest(), [], []
    for opening, sliding in path[:, :, None]:
        state = law.advance(state, opening, sliding)
        forces.append(np.array(law.forces(state, opening, sliding))[:, 0])
        energies.append([law.stored(state, opening, sliding)[0], state.used[0]])
    return np.array(forces), state, np.array(energies)


def fine(*corners: tuple[float, float], steps: int = 500) -> np.ndarray:
    """A path through corners, in steps."""
    ends = np.array([(0.0, 0.0), *corners])
    share = np.linspace(0, 1, steps + 1)[1:, None]
    return np.concatenate([a + share * (b - a) for a, b in pairwise(ends)])


@given(options, st.lists(st.floats(-0.5, 2), min_size=1, max_size=10))
def test_without_sliding_it_is_the_law_in_opening(option: tuple[Softening, Unloading], path: list[float]) -> None:
    law, plain, reached = bond(*option), CentralSoftening(np.array([KN]), FN, DN, *option), np.zeros(1)
    openings = np.array(path) * DN
    forces, state, energies = follow(law, np.column_stack([openings, np.zeros_like(openings)]))
    for opening, force, (stored, used) in zip(openings[:, None], forces, energies, strict=True):
        # D near 1 carries f_max × 2e-16 × δ_max/δ_peak, and so does the way found from it
        assert force[0] == pytest.approx(plain.force(opening, reached)[0], abs=1e-10 * FN)
        reached = plain.reached(opening, reached)
        assert stored == pytest.approx(plain.stored(opening, reached)[0], abs=1e-10 * FN * DN)
        assert used == pytest.approx(plain.dissipated(reached)[0], abs=1e-10 * FN * DN)
        assert force[1] == 0
    if reached[0] > plain.delta_peak[0]:
        # near its end the way is known as well as D: 1e-16 × δ_max/δ_peak over the slope there
        assert law.reached(state)[0] == pytest.approx(min(reached[0], plain.delta_end[0]), rel=1e-8)


@pytest.mark.parametrize("unloading", Unloading)
@pytest.mark.parametrize("degrees", [0, 20, 45, 70, 90])
def test_linear_law_along_a_direction_in_closed_form(degrees: float, unloading: Unloading) -> None:
    """Straight from onset to end of Camanho and Dávila; energies of the modes add up to one."""
    a, b = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    onset = 1 / np.sqrt((KN * a / FN) ** 2 + (KS * b / FT) ** 2)
    end = 1 / (onset * (KN * a**2 / (FN * DN) + KS * b**2 / (FT * DT)))
    stiffness = np.array([KN * a, KS * b])
    size = np.array([0.3 * onset, onset, 0.5 * (onset + end), 0.9 * end, 1.1 * end])
    forces, _, energies = follow(bond(LINEAR, unloading), size[:, None] * [a, b])
    straight = onset * np.clip((end - size) / (end - onset), 0, size / onset)
    assert forces == pytest.approx(straight[:, None] * stiffness, abs=1e-10 * FN)  # asked for
    toughness = 0.5 * onset * end * np.array([KN * a**2, KS * b**2])
    assert toughness[0] / (FN * DN / 2) + toughness[1] / (FT * DT / 2) == pytest.approx(1, rel=1e-14)  # two sums
    assert energies[-1] == pytest.approx([0, toughness.sum()], abs=1e-10 * toughness.sum())  # asked for


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.shape.value)
@pytest.mark.parametrize("unloading", Unloading)
def test_unload_reload_and_compress_at_an_angle(shape: Softening, unloading: Unloading) -> None:
    law, top = bond(shape, unloading), np.array([0.4e-6, 0.5e-6])
    forces, _, _ = follow(law, np.array([top, 0.9 * top, top, [-1e-7, top[1]], top]))
    assert forces[2] == pytest.approx(forces[0], abs=1e-12 * FN)  # reloading comes back to the envelope: roundings
    slope = forces[0] / top if unloading is Unloading.SECANT else np.array([KN, KS])
    assert forces[1] == pytest.approx(forces[0] - slope * 0.1 * top, abs=1e-12 * FN)  # roundings
    # round-off of a product
    assert forces[3] == pytest.approx([-KN * 1e-7, forces[0][1]], abs=1e-12 * FN), "closed: K^n, shear as before"
    assert forces[4] == pytest.approx(forces[0], abs=1e-12 * FN)  # roundings


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.shape.value)
@pytest.mark.parametrize("unloading", Unloading)
def test_work_on_a_path_that_turns(shape: Softening, unloading: Unloading) -> None:
    """Work of the forces is stored or used up; steps that turn cost an error of their own size."""
    path = fine((0.3e-6, 0.1e-6), (0.35e-6, 0.9e-6), (-0.1e-6, 0.6e-6), (0.2e-6, -1.2e-6), (5e-6, 5e-6))
    forces, _, energies = follow(bond(shape, unloading), path)
    start = np.vstack([[0, 0], forces])
    work = np.cumsum(np.sum(0.5 * (start[1:] + start[:-1]) * np.diff(np.vstack([[0, 0], path]), axis=0), axis=1))
    apart = np.abs(work - energies.sum(axis=1)).max()
    assert apart < 5e-4 * FN * DN  # first order in the step; measured up to 1.4e-4
    assert np.all(np.diff(energies[:, 1]) >= -1e-16 * FN * DN), "nothing heals"
    jump = np.abs(np.diff(forces, axis=0)).max()
    assert jump < 0.05 * FN, "forces are continuous where the direction turns"  # measured up to 0.018


def test_no_opening_is_damaged_by_compression_and_shear_is() -> None:
    law = bond()
    forces, state, _ = follow(law, np.array([[-5e-6, 0.0]]))
    assert forces[0] == pytest.approx([-5e-6 * KN, 0], rel=1e-15)  # one product
    assert state.progress == 0
    _, state, _ = follow(law, np.array([[-5e-6, 1.2e-6]]))
    assert 0 < state.progress < 1


@pytest.mark.parametrize("unloading", Unloading)
def test_failed_bonds_rub_when_closed(unloading: Unloading) -> None:
    law, closed = bond(unloading=unloading, friction=0.5), -1e-7  # at most 0.5 × 40 N
    path = np.array(
        [[9e-6, 0], [closed, 0], [closed, 1e-7], [closed, 5e-7], [closed, 4e-7], [closed, -5e-7], [1e-7, -5e-7]]
    )
    forces, _, energies = follow(law, path)
    assert forces[1:, 1] == pytest.approx([0, 10, 20, 10, -20, 0], abs=1e-10)  # K^s × 1e-7 = 10 N; round-off
    assert forces[1:6, 0] == pytest.approx([-40] * 5)
    failing = 0.5 * FN * DN
    slid = [0, 0, 0, 3e-7, 3e-7, 3e-7 + 6e-7]  # beyond the spring of 2e-7 either way
    stored_last = 0.5 * 20**2 / KS
    expected = failing + 20 * np.array(slid)
    assert energies[:6, 1] == pytest.approx(expected, rel=1e-10)  # asked for
    assert energies[6, 1] == pytest.approx(expected[-1] + stored_last, rel=1e-10), "opening lets the spring go"


@pytest.mark.parametrize("unloading", Unloading)
def test_failed_bonds_that_stay_open_slide_at_no_cost(unloading: Unloading) -> None:
    law = bond(unloading=unloading, friction=0.5)
    path = np.array(
        [[9e-6, 0], [1e-6, 3e-6], [1e-6, -5e-6], [-1e-7, -5e-6], [-1e-7, -5.1e-6], [2e-7, -5e-6], [0, 4e-6]]
    )
    forces, _, energies = follow(law, path)
    assert forces[:, 1] == pytest.approx([0, 0, 0, 0, -10, 0, 0], abs=1e-10)  # K^s × 1e-7 = 10 N; round-off
    spring = 0.5 * 10**2 / KS
    expected = 0.5 * FN * DN + np.array([0, 0, 0, 0, 0, spring, spring])
    assert energies[:, 1] == pytest.approx(expected, rel=1e-10)  # round-off


def test_without_friction_failed_bonds_slide_freely() -> None:
    forces, _, _ = follow(bond(), np.array([[9e-6, 0], [-1e-7, 0], [-1e-7, 1e-6]]))
    assert forces[-1] == pytest.approx([-40, 0], rel=1e-15)  # one product


def test_a_bond_without_strength_limit_stays_elastic() -> None:
    law = MixedSoftening(KN, KS, np.inf, np.inf, np.inf, np.inf)
    forces, state, energies = follow(law, np.array([[1e-3, 2e-3], [-1e-3, 2e-3]]))
    expected = np.array([[1e-3 * KN, 2e-3 * KS], [-1e-3 * KN, 2e-3 * KS]])
    assert forces == pytest.approx(expected, rel=1e-15)  # one product
    assert state.progress == 0
    assert (energies[:, 1] == 0).all()
    assert law.reached(state) == 0


@given(options, st.floats(0.1, 10), st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=1, max_size=6))
def test_scaling_law(option: tuple[Softening, Unloading], s: float, path: list[tuple[float, float]]) -> None:
    """All strengths and openings times s, at s times the path: s times the force."""
    law, at = bond(*option), np.array(path) * DN
    scaled = MixedSoftening(KN, KS, s * FN, s * FT, s * DN, s * DT, *option)
    plain, _, _ = follow(law, at)
    again, _, _ = follow(scaled, s * at)
    assert again == pytest.approx(s * plain, rel=1e-9, abs=1e-10 * s * FN)  # cancellation near failure


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"k_s": 0.0}, r"k_s = 0 N/m must be finite and positive"),
        ({"f_shear": -1.0}, r"f_shear = -1 N must be finite and positive"),
        ({"f_max": np.inf}, r"f_shear = 50 N must be inf where f_max is: a bond takes damage in both modes or in none"),
        ({"delta_shear": np.nan}, r"delta_shear = nan m must be finite and positive"),
        ({"delta_shear": 5e-7}, r"delta_shear = 5e-07 m must be larger than f_shear/k_s = 5e-07 m: raise delta_shear"),
        ({"delta_max": 1e-7}, r"delta_max = 1e-07 m must be larger than delta_peak"),
        ({"friction": -0.1}, r"friction = -0\.1 must be finite and zero or positive"),
    ],
)
def test_refusals(change: dict[str, float], sentence: str) -> None:
    values = {"k_n": KN, "k_s": KS, "f_max": FN, "f_shear": FT, "delta_max": DN, "delta_shear": DT} | change
    with pytest.raises(InputError, match=sentence):
        MixedSoftening(**values)

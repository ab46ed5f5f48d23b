"""The bond law: force–opening table, energy along any path, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.softening import LINEAR, Shape, Softening, Unloading

K, F, D = 4.0e8, 80.0, 1.0e-6  # δ_peak = 0.2 µm, softening over 0.8 µm
LAW = LinearSoftening(np.array([K]), np.array([F]), np.array([D]))

laws = st.builds(
    lambda k, f, stretch: LinearSoftening(np.array([k]), np.array([f]), np.array([stretch * f / k])),
    st.floats(1e6, 1e10),
    st.floats(1e-2, 1e4),
    st.floats(1.01, 1e4),
)
paths = st.lists(st.floats(-1.0, 1.5), min_size=1, max_size=12)  # in δ_max


def one(x: float) -> np.ndarray:
    return np.array([x])


@pytest.mark.parametrize(
    ("opening", "reached", "force"),
    [
        (0.0, 0.0, 0.0),
        (1e-7, 0.0, 40.0),
        (2e-7, 0.0, 80.0),
        (6e-7, 0.0, 40.0),  # half way down: 80 × (1 − 0.6)/(1 − 0.2)
        (3e-7, 6e-7, 20.0),  # secant to the origin: half of 40
        (-1e-7, 0.0, -40.0),
        (-1e-7, 6e-7, -40.0),  # compression stays elastic after damage …
        (-1e-7, 2e-6, -40.0),  # … and after failure
        (5e-7, 2e-6, 0.0),
        (3e-6, 0.0, 0.0),
    ],
)
def test_force_opening_table(opening: float, reached: float, force: float) -> None:
    assert LAW.force(one(opening), one(reached))[0] == pytest.approx(force, abs=1e-12 * F)  # round-off of one product


def test_a_bond_without_strength_limit_stays_elastic() -> None:
    law = LinearSoftening(one(K), one(np.inf), one(np.nan))
    assert law.force(one(1.0), one(2.0))[0] == K
    assert law.dissipated(one(1.0))[0] == 0
    assert law.damage(one(1.0))[0] == 0
    assert law.softened_share(one(1.0))[0] == 0


@given(laws)
def test_breaking_uses_half_of_strength_times_opening(law: LinearSoftening) -> None:
    area = 0.5 * law.f_max * law.delta_max
    assert law.dissipated(3 * law.delta_max) == pytest.approx(area, rel=1e-14)  # one product and one sum
    assert law.dissipated(law.delta_peak) == 0
    assert law.damage(law.delta_max) == 1
    assert law.softened_share(law.delta_max) == pytest.approx(1, rel=1e-14)


@given(laws, paths)
def test_work_along_any_path_is_stored_plus_dissipated(law: LinearSoftening, path: list[float]) -> None:
    """The law is piecewise linear, so trapezoids between its corners integrate it exactly."""
    work, before, reached = 0.0, 0.0, np.zeros(1)
    for target in np.asarray(path) * law.delta_max[0]:
        corners = [c for c in (0.0, reached[0], law.delta_peak[0], law.delta_max[0]) if (c - before) * (target - c) > 0]
        for stop in [*sorted(corners, reverse=bool(target < before)), target]:
            both = law.force(np.array([before, stop]), np.repeat(reached, 2))
            work += 0.5 * (both[0] + both[1]) * (stop - before)
            reached, before = law.reached(one(stop), reached), stop
    balance = law.stored(one(before), reached) + law.dissipated(reached)
    scale = law.k_n[0] * (np.abs(path).max() * law.delta_max[0]) ** 2 + law.f_max[0] * law.delta_max[0]
    assert work == pytest.approx(balance[0], abs=1e-13 * scale)  # round-off of a dozen sums


@given(laws, paths)
def test_memory_never_heals(law: LinearSoftening, path: list[float]) -> None:
    reached, damage = np.zeros(1), 0.0
    for opening in path:
        reached = law.reached(one(opening) * law.delta_max, reached)
        assert law.damage(reached)[0] >= damage - 1e-15  # one rounding
        damage = law.damage(reached)[0]
        assert 0 <= damage <= 1


@given(laws, st.floats(0.1, 10), st.floats(-1, 2), st.floats(0, 2))
def test_scaling_law(law: LinearSoftening, s: float, opening: float, reached: float) -> None:
    """(s f_max, s δ_max) at s times the opening carries s times the force (physics: exact)."""
    scaled = LinearSoftening(law.k_n, s * law.f_max, s * law.delta_max)
    plain = law.force(opening * law.delta_max, reached * law.delta_max)
    again = scaled.force(opening * scaled.delta_max, reached * scaled.delta_max)
    assert again == pytest.approx(s * plain, rel=1e-9, abs=1e-12 * s * law.f_max[0])  # cancellation at δ_max


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ((0.0, F, D), r"k_n = 0 N/m must be finite and positive"),
        ((K, -1.0, D), r"f_max = -1 N must be positive \(inf: the bond takes no damage\)"),
        ((K, np.nan, D), r"f_max = nan N must be positive"),
        ((np.nan, F, D), r"k_n = nan N/m"),
        ((K, F, np.nan), r"delta_max = nan m must be finite and positive"),
        ((K, F, -1e-6), r"delta_max = -1e-06 m"),
        (
            (K, F, 2e-7),
            r"delta_max = 2e-07 m must be larger than delta_peak = f_max/k_n = 2e-07 m: raise delta_max or lower f_max",
        ),
    ],
)
def test_refusals(values: tuple[float, float, float], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        LinearSoftening(*(one(v) for v in values))


SHAPES = [LINEAR, Softening(Shape.EXPONENTIAL), Softening(Shape.BILINEAR_TAIL), Softening(Shape.BILINEAR_TAIL, 0.5)]
shaped = st.builds(
    lambda k, f, stretch, shape, unloading: CentralSoftening(one(k), one(f), one(stretch * f / k), shape, unloading),
    st.floats(1e6, 1e10),
    st.floats(1e-2, 1e4),
    st.floats(1.01, 1e4),
    st.sampled_from(SHAPES),
    st.sampled_from(Unloading),
)


@pytest.mark.parametrize(
    ("shape", "unloading", "opening", "reached", "force"),
    [
        # K 4e8, F 80, δ_peak 0.2 µm, δ_max 1 µm: s = (δ − 0.2)/0.8
        (Softening(Shape.BILINEAR_TAIL), "secant", 5.2e-7, 0.0, 80 / 3),  # the kink, s = 0.4
        (Softening(Shape.BILINEAR_TAIL), "secant", 2.6e-7, 5.2e-7, 40 / 3),
        (Softening(Shape.BILINEAR_TAIL), "elastic", 5.0e-7, 5.2e-7, 80 / 3 - 8),
        (Softening(Shape.BILINEAR_TAIL), "elastic", 4.0e-7, 5.2e-7, 0.0),  # plastic opening: 0.52 − 0.0667 µm
        (Softening(Shape.BILINEAR_TAIL), "elastic", -1e-7, 5.2e-7, -40.0),
        (LINEAR, "elastic", 5.5e-7, 6e-7, 20.0),
        (LINEAR, "elastic", 6e-7, 6e-7, 40.0),
        (LINEAR, "elastic", 7e-7, 6e-7, 30.0),
        (Softening(Shape.EXPONENTIAL), "secant", 3.5e-6, 0.0, 0.0),  # s = 4.125: past its end
    ],
)
def test_force_opening_table_of_options(
    shape: Softening, unloading: str, opening: float, reached: float, force: float
) -> None:
    law = CentralSoftening(one(K), one(F), one(D), shape, Unloading(unloading))
    assert law.force(one(opening), one(reached))[0] == pytest.approx(force, abs=1e-12 * F)  # round-off


@given(shaped)
def test_breaking_uses_the_same_energy_whatever_the_shape(law: CentralSoftening) -> None:
    area = 0.5 * law.f_max * law.delta_max
    assert law.dissipated(2 * law.delta_end) == pytest.approx(area, rel=1e-13)  # a product and three sums
    assert law.damage(law.delta_end) == pytest.approx(1, abs=1e-12)  # rounding of the end over a way of 0.01 δ_peak
    assert law.softened_share(law.delta_end) == pytest.approx(1, rel=1e-12)  # as before, over a small difference


@settings(max_examples=40)
@given(shaped, paths)
def test_work_of_any_shape_is_stored_plus_dissipated(law: CentralSoftening, path: list[float]) -> None:
    """Gauss quadrature between the corners of the law."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    work, before, reached = 0.0, 0.0, np.zeros(1)
    peak, last = law.delta_peak[0], law.delta_max[0]
    fixed = [0.0, peak, peak + law.softening.kink * (last - peak), law.delta_end[0]]
    for target in np.asarray(path) * law.delta_end[0]:
        corners = sorted(c for c in [*fixed, reached[0], law.plastic(reached)[0]] if (c - before) * (target - c) > 0)
        for stop in [*(corners if target > before else corners[::-1]), target]:
            at = before + (nodes + 1) / 2 * (stop - before)
            force = [law.force(one(x), reached)[0] for x in at]
            work += (stop - before) / 2 * float(weights @ force)
            reached, before = law.reached(one(stop), reached), stop
    balance = law.stored(one(before), reached) + law.dissipated(reached)
    scale = law.k_n[0] * (np.abs(path).max() * law.delta_end[0]) ** 2 + law.f_max[0] * law.delta_max[0]
    assert work == pytest.approx(
        balance[0], abs=1e-12 * scale
    )  # round-off of sums; 16 nodes take an exponential to 1e-13


@given(st.sampled_from(SHAPES), st.floats(-1, 2), st.floats(0, 2))
def test_linear_and_secant_are_the_plain_law(shape: Softening, opening: float, reached: float) -> None:
    general, plain = CentralSoftening(one(K), one(F), one(D)), LAW
    at, seen = one(opening * D), one(reached * D)
    # round-off of a few products, of the size of each
    for name, scale in (("force", F), ("stored", F * D)):
        assert getattr(general, name)(at, seen) == pytest.approx(getattr(plain, name)(at, seen), abs=1e-13 * scale)
    for name, scale in (("envelope", F), ("secant", K), ("dissipated", F * D), ("damage", 1)):
        assert getattr(general, name)(seen) == pytest.approx(getattr(plain, name)(seen), abs=1e-13 * scale)


def test_part_and_scaled_law_keep_their_options() -> None:
    law = CentralSoftening(np.array([K, 2 * K]), one(F), one(D), SHAPES[2], Unloading.ELASTIC)
    assert law.of(np.array([1])).k_n == [2 * K]
    assert law.of(np.array([1])).softening == SHAPES[2]
    assert law.scaled(2.0).unloading is Unloading.ELASTIC
    assert LAW.scaled(2.0).delta_max == [2 * D]
    assert isinstance(LAW.of(np.array([0])), LinearSoftening)

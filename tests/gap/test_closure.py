"""Where and how far: shares, floors and closures that are known."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.gap.candidate import Candidate
from pipeline.gap.closure import DRAWS, closure, folds, held_out, left_by_complete
from pipeline.gap.effect import Magnitude
from pipeline.gap.fit import Data
from pipeline.gap.metric import Metric
from pipeline.gap.modes import shapes
from pipeline.gap.observation import Observation, Reading
from pipeline.gap.where import regions, where
from tests.gap.scene import discrepancy, observed, sight

SIZE = Magnitude(-50.0, 50.0, 20.0, "µm")


def scene(value: float, seed: int = 0, noise: float = 0.4e-6):
    """A test of two parameters (a shift and a load) in which the mouth opens by `value` µm at the last station."""
    seen, rng = sight(), np.random.default_rng(seed)
    s, p = seen.cmod.size, len(seen.points)
    growth = seen.cmod / seen.cmod[-1]
    opening = 1e-6 * growth[:, None, None] * shapes(seen)[..., 6]
    shift = 1e-6 * growth[:, None, None] * shapes(seen)[..., 0]

    def field_and_load(parameters: np.ndarray, amplitude: float) -> np.ndarray:
        return np.concatenate([(parameters[0] * shift + amplitude * opening).ravel(), 100 * parameters[1] * growth])

    truth = field_and_load(np.array([3.0, 2.0]), value)
    reading = Reading(truth[: 2 * s * p].reshape(s, p, 2), truth[2 * s * p :])
    test = observed(seen, reading, rng, noise)
    size = discrepancy(0.1).covariance(seen, 200.0) + np.diag(test.noise)
    data = Data(test.reading.flat(), Metric(size), np.array([[-20.0, 20.0], [-20.0, 20.0]]))
    none = Candidate((), (), lambda x, a: field_and_load(x, 0.0))
    right = Candidate(("opening",), (SIZE,), lambda x, a: field_and_load(x, a[0]))
    return test, data, none, right


def closed(value: float, wrong: bool = False):
    test, data, none, right = scene(value)
    within, across = folds(test)
    start = np.zeros(2)
    other = none if wrong else right
    parts = [held_out(c, data, within + across, start) for c in (none, other)]
    complete = left_by_complete(none, data, within, start, np.random.default_rng(2))
    return closure(test, data, *parts, complete, np.random.default_rng(1))


def test_a_complete_model_leaves_what_linear_least_squares_say():
    """Held-out residuals of a linear model: Cov = Σ_hh + J C Jᵀ − both products of J with Cov(λ, held)."""
    test, data, none, _ = scene(0.0)
    [fold, *_], _ = folds(test)
    found = left_by_complete(none, data, [fold], np.zeros(2), np.random.default_rng(0))[0][fold.held]
    slopes = np.column_stack([none.predict(row, np.zeros(0)) for row in np.eye(2)])
    rest, size = ~fold.held, data.metric.covariance
    inverse = np.linalg.inv(size[np.ix_(rest, rest)])
    normal = slopes[rest].T @ inverse @ slopes[rest] + 12 * np.eye(2) / 40**2  # and the box of width 40
    gain = slopes[fold.held] @ np.linalg.solve(normal, slopes[rest].T @ inverse)
    whole = np.hstack([np.eye(fold.held.sum()), -gain])
    order = np.concatenate([np.flatnonzero(fold.held), np.flatnonzero(rest)])
    exact = np.sqrt(np.diag(whole @ size[np.ix_(order, order)] @ whole.T))
    # four standard errors of a standard deviation from so many draws
    assert np.allclose(found.std(axis=1) / exact, 1.0, atol=4 / np.sqrt(2 * DRAWS))


def test_the_true_effect_closes_all_of_the_gap():
    found = closed(40.0)
    assert not found.nothing
    assert found.fraction == pytest.approx(1.0, abs=0.1)  # the floor is an average over draws
    assert found.whole.interval[0] > 0.8
    assert found.after.displacement_um < 0.1 * found.before.displacement_um


def test_every_channel_has_its_own_share():
    """The opening shows in the field alone: there it closes the gap, in the load there is none."""
    found = closed(40.0)
    assert found.channels["field"].fraction == pytest.approx(1.0, abs=0.1)  # the floor is an average over draws
    assert found.channels["load"].nothing
    assert found.channels["field"].before > found.whole.before > found.channels["load"].before


def test_an_effect_that_does_nothing_closes_nothing():
    assert closed(40.0, wrong=True).fraction == pytest.approx(0.0, abs=1e-9)  # the very same predictions


def test_where_nothing_is_left_there_is_nothing_to_close():
    found = closed(0.0)
    assert found.nothing
    assert np.isnan(found.fraction)


def test_folds_hold_out_every_datum_twice_and_channels_once():
    test, *_ = scene(0.0)
    within, across = folds(test)
    is_field = np.arange(test.mask.size) < test.reading.field.size
    times = np.sum([f.held for f in within], axis=0)
    assert (times[is_field] == 2).all()
    assert (times[~is_field] == 1).all()  # a load belongs to no point
    assert [f.name for f in across] == ["load from field", "field from load"]


def test_the_table_names_channel_stage_and_mode_of_what_was_put_in():
    test, data, *_ = scene(40.0)
    residual = data.target - scene(0.0, noise=1e-12)[1].target
    cells = where(test, residual, data.metric.covariance)
    assert (cells[0].channel, cells[0].mode) == ("field", "opening")
    assert cells[0].stage == "tail"
    assert sum(c.share for c in cells) == pytest.approx(1.0)
    opening = [c for c in cells if c.mode == "opening" and c.stage == "tail"]
    growth = (test.sight.cmod / test.sight.cmod[-1])[test.sight.stage == 2]
    for cell in opening:  # half of 40 µm on either flank
        assert cell.rms == pytest.approx(20 * np.sqrt(np.mean(growth**2)), rel=0.05)


def test_pure_discrepancy_and_noise_stand_at_one():
    test, data, *_ = scene(0.0)
    root = np.linalg.cholesky(data.metric.covariance)
    rng, found = np.random.default_rng(3), {}
    for _ in range(30):
        for cell in where(test, root @ rng.standard_normal(len(root)), data.metric.covariance):
            found.setdefault((cell.channel, cell.stage, cell.region, cell.mode), []).append(cell.z_gap**2)
    # 30 draws of one to three waves each: the mean square is 1 within 0.3 a cell, of some 50 cells
    assert np.mean([np.mean(v) for v in found.values()]) == pytest.approx(1.0, abs=0.1)


def test_regions_are_told_by_distance():
    seen = sight(columns=(-40.0, -9.0, 1.0, 60.0), rows=(0.0,))
    assert regions(seen).tolist() == [2, 1, 0, 2]


def test_loads_alone_have_a_table_of_their_own():
    test, data, *_ = scene(10.0)
    nothing = np.full_like(test.reading.field, np.nan)
    part = Observation(test.sight, Reading(nothing, test.reading.load), test.field_std, test.load_std)
    keep = part.mask
    cells = where(part, data.target[keep], data.metric.part(keep).covariance)
    assert {c.channel for c in cells} == {"load"}
    within, across = folds(part)
    assert across == []
    assert {f.name for f in within} <= {"pre-peak", "peak", "tail"}

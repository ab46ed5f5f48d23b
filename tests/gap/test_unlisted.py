"""An effect of unknown shape: its evidence in closed form, and what it is for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from pipeline.gap.diagnosis import diagnose
from pipeline.gap.fit import fit
from pipeline.gap.observation import Observation
from pipeline.gap.score import UNLISTED
from pipeline.gap.unlisted import LENGTHS, SIZES, sizes, unlisted, waves
from pipeline.gap.weighing import weighed
from tests.gap.linear import factor_log_bayes
from tests.gap.scene import ABSCISSAE, START, entry, measured, simulate

SOME = ["cmod_gain", "lens_distortion", "magnification", "modulus"]


def found(observation: Observation, names=SOME):
    few = (0.8, 1.0, 1.2)
    return diagnose(observation, ABSCISSAE, simulate, START, entry(), np.random.default_rng(0), names, few)


def odd(size: float, seed: int = 2) -> Observation:
    """A specimen that slides along its crack and tilts, more so the wider it opens: no effect of `SOME` does that."""
    test = measured(rng=np.random.default_rng(seed))
    sight = test.sight
    more = size * sight.cmod / sight.cmod[-1]
    field = test.reading.field.copy()
    field[..., 1] += 0.5 * more[:, None] * sight.side + more[:, None] * sight.points[:, 0] / 10e-3
    return replace(test, reading=replace(test.reading, field=field))


def test_what_nobody_thought_of_is_outside_the_library():
    d = found(odd(60e-6))
    assert d.verdict.kind == UNLISTED
    assert d.scored.ranked()[0] == UNLISTED
    assert d.best is d.fits[UNLISTED]


@pytest.mark.parametrize(("name", "value"), [("magnification", 2e-3), ("cmod_gain", 0.08)])
def test_a_shape_that_is_right_is_cheaper_and_a_wrong_one_dearer(name, value):
    test = measured([name], [value], np.random.default_rng(1))
    whole = found(test)
    assert whole.scored.ranked()[0] == name
    assert whole.scored.log_bayes[name] - whole.scored.log_bayes[UNLISTED] > 5
    lacking = found(test, [n for n in SOME if n != name])
    assert lacking.verdict.kind == UNLISTED
    assert lacking.scored.probability[UNLISTED] > 0.9


def test_of_a_test_that_lacks_nothing_it_is_no_explanation():
    for seed in range(2):
        d = found(measured(rng=np.random.default_rng(seed)))
        assert d.scored.log_bayes[UNLISTED] < 0
        assert d.verdict.kind == "none needed"


def test_its_evidence_is_that_of_a_gaussian_process():
    """Against restricted likelihoods of the whole matrices, in which the hinge is taken as linear in its parameters."""
    test = odd(5e-6)
    emulator = found(test).emulator
    seen, data = weighed(test, emulator, entry())
    assert weighed(test, emulator, heavy())[1].metric.log_volume == pytest.approx(data.metric.log_volume)
    none = fit(emulator.candidate([], seen.mask), data)
    known = {n: emulator.candidate([n], seen.mask) for n in SOME}
    target = data.target - none.candidate.predict(none.parameters, np.zeros(0))
    own = sizes(seen, none, known)
    alike = np.vstack([np.sqrt(np.mean(own[:-1] ** 2, axis=0)) * np.ones_like(own[:-1]), own[-1:]])
    exact = [
        factor_log_bayes(target, data.metric.covariance, _slopes(none, data), factor**2 * waves(seen, wide, length))
        for wide in (own, alike)
        for length in LENGTHS
        for factor in SIZES
    ]
    ours = unlisted(seen, data, none, known).log_evidence - none.log_evidence
    assert ours == pytest.approx(logsumexp(exact) - np.log(len(exact)), abs=0.2)  # what is not linear in the parameters


def test_where_scales_are_unknown_it_is_a_mixture_over_them():
    """Of a wave as small as nothing the evidence is that of none; of a real one a mean over scales of Σ."""
    test = odd(5e-6)
    emulator = found(test).emulator
    seen, data = weighed(test, emulator, heavy())
    none = fit(emulator.candidate([], seen.mask), data)
    known = {n: emulator.candidate([n], seen.mask) for n in SOME}
    tiny = {
        n: replace(c, magnitudes=(replace(c.magnitudes[0], scale=1e-6 * c.magnitudes[0].scale),))
        for n, c in known.items()
    }
    assert unlisted(seen, data, none, tiny).log_evidence == pytest.approx(none.log_evidence, abs=1e-3)
    sure = weighed(test, emulator, entry())[1]
    plain = fit(emulator.candidate([], seen.mask), sure)
    gains = [unlisted(seen, d, n, known).log_evidence - n.log_evidence for d, n in ((data, none), (sure, plain))]
    assert gains[0] < gains[1]  # a test may also just differ more than most


def heavy():
    """The scene's entry, of which the scale of the modes is unknown."""
    one = entry()
    return replace(one, discrepancy=replace(one.discrepancy, tail=6.0))


def _slopes(none, data) -> np.ndarray:
    step = 1e-4 * data.width
    rows = [
        none.candidate.predict(none.parameters + d, np.zeros(0))
        - none.candidate.predict(none.parameters - d, np.zeros(0))
        for d in np.diag(step)
    ]
    return np.column_stack(rows) / (2 * step)

"""The explanation that no library can hold: an effect of unknown shape, smooth and as large as effects are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from pipeline.gap.candidate import Candidate
from pipeline.gap.fit import Data, Fitted, fit
from pipeline.gap.metric import Metric
from pipeline.gap.modes import MODES, amplitudes, shapes
from pipeline.gap.observation import Observation

SIZES = (0.1, 0.25, 0.5, 1.0, 2.0)  # of what an effect of the library does at its prior's scale; equally probable
LENGTHS = (0.3, 1.0)  # of the CMOD that is looked at, over which its waves reach; equally probable


def unlisted(observation: Observation, data: Data, none: Fitted, known: Mapping[str, Candidate]) -> Fitted:
    """Fit the model as it is beside a wave in every mode and in the load, independent of each other.

    The wave has at each station the root mean square of what the library's effects do there, in every mode as much as
    they do in that one, or as much as in the modes on average. So the evidence of an effect that explains half of a gap
    is held against that of one that nobody has thought of: a Gaussian process instead of a shape, which is dearer than
    the right shape and cheaper than a wrong one.

    Parameters
    ----------
    observation : Observation
    data : Data of its data
    none : Fitted, of the model as it is
    known : effect → its candidate; at least one

    Returns
    -------
    the fit at the likeliest size and length, with the evidence of them all
    """
    found = []
    own = sizes(observation, none, known)
    alike = np.vstack([np.broadcast_to(np.sqrt(np.mean(own[:-1] ** 2, axis=0)), own[:-1].shape), own[-1:]])
    for wide, length, size in product((own, alike), LENGTHS, SIZES):
        covariance = data.metric.covariance + size**2 * waves(observation, wide, length)
        metric = Metric(covariance, data.metric.uncertain, data.metric.tail)
        one = fit(none.candidate, replace(data, metric=metric), none.parameters)
        found.append((one, one.log_evidence - 0.5 * (metric.log_volume - data.metric.log_volume)))
    best, _ = max(found, key=lambda one: one[1])
    return replace(best, log_evidence=float(logsumexp([value for _, value in found]) - np.log(len(found))))


def waves(observation: Observation, size: np.ndarray, length: float) -> np.ndarray:
    """Covariance (n, n) of the data for waves of such sizes (k + 1, s), that reach so far."""
    o, sight = observation, observation.sight
    s, p = sight.cmod.size, len(sight.points)
    along = np.exp(-0.5 * (np.subtract.outer(sight.cmod, sight.cmod) / (length * sight.cmod[-1])) ** 2)
    basis, cut = shapes(sight).reshape(2 * p, len(MODES)), 2 * s * p
    found = np.zeros((cut + s, cut + s))
    modes = np.einsum("ks,kt,st->kst", size[:-1], size[:-1], along)
    found[:cut, :cut] = np.einsum("ak,kst,bk->satb", basis, modes, basis, optimize=True).reshape(cut, cut)
    found[cut:, cut:] = np.outer(size[-1], size[-1]) * along
    return found[np.ix_(o.mask, o.mask)]


def sizes(observation: Observation, none: Fitted, known: Mapping[str, Candidate]) -> np.ndarray:
    """Root mean square (k + 1, s) of what effects do to the modes, m, and to the load, N, at their priors' scales."""
    o = observation
    s, p = o.sight.cmod.size, len(o.sight.points)
    take = amplitudes(o.sight, o.mask[: 2 * s * p : 2].reshape(s, p))
    square = np.zeros((len(MODES) + 1, s))
    base = none.candidate.predict(none.parameters, np.zeros(0))
    for candidate in known.values():
        for row in np.diag([min(m.scale, m.high) for m in candidate.components]):
            change = np.zeros(o.mask.size)
            change[o.mask] = candidate.predict(none.parameters, row) - base
            wave = np.einsum("ska,sa->ks", take, change[: 2 * s * p].reshape(s, 2 * p))
            square += np.vstack([wave, change[2 * s * p :]]) ** 2 / len(row)
    return np.asarray(np.sqrt(square / len(known)))

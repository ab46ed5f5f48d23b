"""What a naive judge would say: candidates weighed against white noise alone, as if simulators were perfect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.gap.fit import Data, Fitted, climbed
from pipeline.gap.metric import Metric
from pipeline.gap.observation import Observation
from pipeline.gap.score import NONE, UNLISTED


def noise_bic(observation: Observation, data: Data, fits: Mapping[str, Fitted]) -> dict[str, float]:
    """Bayesian information criterion χ² + k ln n of every candidate, refitted with noise alone (Schwarz 1978).

    A baseline to compare verdicts with, no verdict: what two simulators differ by is many times the noise, so the
    richest candidate wins.

    Parameters
    ----------
    observation : Observation
    data : Data of its data; the metric is not used
    fits : label → Fitted, where the refits start; "none" among them; an effect of unknown shape has no such fit
    """
    bare = replace(data, metric=Metric(np.diag(observation.noise[observation.mask])))
    plain = fits[NONE]
    alone, *_ = climbed(plain.candidate, bare, plain.parameters)
    found = {}
    for label, fitted in fits.items():
        if label == UNLISTED:
            continue
        without = np.append(alone, np.zeros(fitted.amplitudes.size))
        starts = [np.append(fitted.parameters, fitted.amplitudes), without]
        square = min(climbed(fitted.candidate, bare, start)[1] for start in starts)
        found[label] = square + without.size * float(np.log(data.target.size))
    return found

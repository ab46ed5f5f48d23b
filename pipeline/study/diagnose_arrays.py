"""The arrays of a diagnosis: what its figures are drawn from, so that they can be drawn anew."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.fit import Fitted
from pipeline.gap.modes import MODES, amplitudes
from pipeline.gap.observation import Observation, Reading
from pipeline.gap.score import NONE

SHOWN = 3  # explanations beside none
ROWS = 240  # of a curve


def shown(diagnosis: Diagnosis) -> list[Fitted]:
    """The model as it is, then the most probable explanations."""
    best = diagnosis.scored.causes()[:SHOWN]
    return [diagnosis.fits[label] for label in (NONE, *best)]


def reading_of(diagnosis: Diagnosis, fitted: Fitted) -> Reading:
    """What camera and load cell would say at the stations, at the best point of an explanation."""
    return diagnosis.emulator.reading(fitted.parameters, fitted.candidate.names, fitted.amplitudes)


def whole_curve(diagnosis: Diagnosis, fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
    """CMOD (rows,), m, and load (rows,), N, that gauge and machine would record, up to the last station."""
    sight = diagnosis.emulator.sight
    cmod = np.linspace(0.0, sight.cmod[-1], ROWS + 1)[1:]
    rest = sight.time[0] - sight.cmod[0] * (sight.time[1] - sight.time[0]) / (sight.cmod[1] - sight.cmod[0])
    time = np.interp(cmod, np.append(0.0, sight.cmod), np.append(rest, sight.time))
    dense = replace(diagnosis.emulator, sight=replace(sight, cmod=cmod, time=time, load=np.zeros(0)))
    return cmod, dense.reading(fitted.parameters, fitted.candidate.names, fitted.amplitudes).load


def diagnosis_arrays(diagnosis: Diagnosis, path: np.ndarray) -> dict[str, Any]:
    """Arrays by the names of layout `DIAGNOSE`.

    Parameters
    ----------
    diagnosis : Diagnosis
    path : (k, 2) array, m; of the crack that simulations are held to
    """
    d, o = diagnosis, diagnosis.observation
    fitted = shown(d)
    readings = [reading_of(d, f) for f in fitted]
    curves = [whole_curve(d, f) for f in fitted]
    field, load = (o.reading.field, o.field_std), (o.reading.load, o.load_std)
    return {
        "stations/cmod_m": o.sight.cmod,
        "stations/time_s": o.sight.time,
        "stations/stage": o.sight.stage,
        "points_m": o.sight.points,
        "points_side": o.sight.side,
        "path_m": path,
        **dict(zip(("measured/displacement_m", "measured/displacement_std_m"), field if o.has_field else (None, None),
                   strict=True)),
        **dict(zip(("measured/load_n", "measured/load_std_n"), load if o.has_load else (None, None), strict=True)),
        "compared": o.mask,
        "covariance": d.data.metric.covariance,
        "noise_variance": o.noise[o.mask],
        "explanations": [f.candidate.label for f in fitted],
        "simulated/parameters": [f.parameters for f in fitted],
        "simulated/displacement_m": [r.field for r in readings],
        "simulated/load_n": [r.load for r in readings],
        "curve/cmod_m": curves[0][0],
        "curve/load_n": [load for _, load in curves],
        "grid/f_max_n": d.emulator.f_max,
        "grid/delta_max_m": d.emulator.delta_max,
        **mode_arrays(o, d.data.metric.covariance, readings),
    }  # fmt: skip


def mode_arrays(o: Observation, covariance: np.ndarray, readings: list[Reading]) -> dict[str, Any]:
    """Amplitudes of the modes in measured − simulated (e, modes, stations), m, and their standard deviations."""
    if not o.has_field:
        return {"modes/names": list(MODES)}
    s, p = o.sight.cmod.size, len(o.sight.points)
    use = o.mask[: 2 * s * p : 2].reshape(s, p)
    take, seen = amplitudes(o.sight, use), np.repeat(use, 2, axis=1)
    left = [np.where(seen, (o.reading.field - r.field).reshape(s, 2 * p), 0.0) for r in readings]
    place = np.cumsum(o.mask) - 1
    noise, both = np.zeros((2, len(MODES), s))
    for k in range(s):
        here, there = take[k][:, seen[k]], place[2 * p * k : 2 * p * (k + 1)][seen[k]]
        noise[:, k] = np.sqrt(here**2 @ o.noise[o.mask][there])
        both[:, k] = np.sqrt(np.einsum("ma,ab,mb->m", here, covariance[np.ix_(there, there)], here))
    return {
        "modes/names": list(MODES),
        "modes/amplitude_m": [np.einsum("ska,sa->ks", take, x) for x in left],
        "modes/noise_std_m": noise,
        "modes/std_m": both,
    }

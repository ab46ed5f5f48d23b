"""A diagnosis by the keys of result.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.core.units import MM, UM
from pipeline.gap.closure import Closure, Distance, Share
from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.effects import effect, library
from pipeline.gap.fit import Fitted
from pipeline.gap.gate import Gate
from pipeline.gap.identifiability import DETECTED, Card
from pipeline.gap.score import NONE, Scored, names_of
from pipeline.gap.verdict import CAUSE, Verdict
from pipeline.gap.weighing import scatter
from pipeline.store.bundle import Bundle
from pipeline.study.diagnose_sight import Seen


def diagnosis_result(
    bundle: Bundle, look: Seen, diagnosis: Diagnosis, warnings: list[str], radius: float
) -> dict[str, Any]:
    """What result.json holds, but for the time taken and the engine."""
    d, area = diagnosis, bond_area(bundle)
    return {
        "version": __version__,
        "command": "diagnose",
        "bundle": bundle.name,
        "bond_area_mm2": area / MM**2,
        "geometry": bundle.specimen.geometry,
        "radius_mm": radius / MM,
        "verdict": d.verdict.kind,
        "named": list(d.verdict.named),
        "reason": d.verdict.reason,
        "probability": dict(sorted(d.scored.probability.items(), key=lambda item: -item[1])),
        "log_bayes": dict(d.scored.log_bayes),
        "takes_part": {n: d.scored.part(n) for n in d.card.names},
        "temperature": d.scored.temperature,
        "set_90": d.scored.credible(),
        "equivalence_classes": [list(c) for c in d.card.classes],
        "cannot_exclude": excluded_not(d.scored, d.card, d.verdict, d.untested),
        "estimate": {n: estimate(d, n) for n in _single(d)},
        "where": [vars(cell) for cell in d.cells],
        "closure": {label: closure_result(c) for label, c in d.closures.items()},
        **card_result(d.card),
        "gate": gate_result(d.gate),
        "scatter": scatter_result(d),
        "not_tested": dict(d.untested),
        "parameters_before": parameters(d.fits[NONE], d.scored.temperature, area),
        "parameters_after": parameters(d.best, d.scored.temperature, area),
        "bias_removed": bias(d.fits[NONE].parameters, d.best.parameters),
        "noise_bic": dict(d.noise_bic),
        "separate_by": remedies(d.scored, d.card, d.verdict, d.untested),
        "equivalents": {n: list(e.equivalents) for n, e in library().items() if e.equivalents},
        "warnings": [*warnings, *own_warnings(d.card, d.fits[NONE].at_edge)],
        "remarks": list(look.remarks),
        "simulations": d.runs,
        "data": int(d.data.target.size),
    }


def own_warnings(card: Card, at_edge: bool) -> list[str]:
    """What a reader must know before the verdict; `at_edge`: of the model as it is."""
    found = []
    if at_edge:
        found.append(
            "the fit of the model as it is lies on the edge of the grid: an effect pulls it there, or [start] is far "
            "off"
        )
    if len(card.hidden) == len(card.names):
        found.append(
            "no effect of the library would show in these data at any plausible size: `none needed` then says nothing "
            "of the model, and its parameters are as uncertain as their intervals say"
        )
    return found


def _single(d: Diagnosis) -> list[str]:
    return [n for n in d.card.names if n in d.fits]


def finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def estimate(d: Diagnosis, name: str) -> dict[str, Any]:
    """How large an effect is if it is the only one."""
    fitted, temperature = d.fits[name], d.scored.temperature
    [value], [interval] = fitted.values(temperature), fitted.interval(temperature=temperature)
    return {"value": float(value), "unit": effect(name).magnitude.unit, "interval_95": interval.tolist()}


def card_result(c: Card) -> dict[str, Any]:
    """What could have been seen and told apart."""
    return {
        "detection_limit": {
            n: {"value": finite(limit), "unit": effect(n).magnitude.unit, "d_prime_at_most": float(at_most)}
            for n, limit, at_most in zip(c.names, c.limit, c.d_prime, strict=True)
        },
        "remaining_d_prime": {
            n: {"value": float(v), **dict(zip(c.names, row.tolist(), strict=True))}
            for n, v, row in zip(c.names, c.looked_at, c.remaining, strict=True)
        },
    }


def gate_result(gate: Gate) -> dict[str, dict[str, float]]:
    """What the best explanation leaves, by mode."""
    return {m: {"chi_square_per_dof": gate.ratio[m], "limit": gate.limit[m]} for m in gate.ratio}


def scatter_result(d: Diagnosis) -> dict[str, dict[str, float | None]]:
    """How far simulations scatter without order: over the grid, and by nudges of the parameters; root mean squares."""
    mask = d.observation.mask
    is_field = (np.arange(mask.size) < d.observation.reading.field.size)[mask]
    jitter = d.emulator.jitter(mask)
    by_nudges = np.mean(jitter**2, axis=0) if len(jitter) else None
    sizes = {"all": np.diag(scatter(d.emulator, mask)), "by_nudges": by_nudges}
    found: dict[str, dict[str, float | None]] = {}
    for name, square in sizes.items():
        field, load = (
            None if square is None or not part.any() else float(np.sqrt(np.mean(square[part])))
            for part in (is_field, ~is_field)
        )
        found[name] = {"displacement_um": None if field is None else field / UM, "load_n": load}
    return found


def excluded_not(scored: Scored, card: Card, verdict: Verdict, untested: Mapping[str, str]) -> list[str]:
    """Effects these data do not rule out: untested, too small to be seen, or still in the 90 % set."""
    likely = {n for label in scored.credible() for n in names_of(label)}
    found = {*untested, *card.hidden, *likely, *(m for n in verdict.named for m in card.class_of(n))}
    return sorted(found - set(verdict.named if verdict.kind == CAUSE else ()))


def remedies(scored: Scored, card: Card, verdict: Verdict, untested: Mapping[str, str]) -> list[str]:
    """What to measure next, for what is named and its rivals first, then for what cannot be seen."""
    first = [n for label in scored.credible() for n in names_of(label)] + list(verdict.named)
    hidden = excluded_not(scored, card, verdict, untested)
    return [f"{n}: {effect(n).remedy}" for n in dict.fromkeys([*first, *hidden])]


def closure_result(c: Closure) -> dict[str, Any]:
    """One closure by its keys."""
    return {
        **share_result(c.whole),
        "channels": {channel: share_result(share) for channel, share in c.channels.items()},
        "before": _distance(c.before),
        "after": _distance(c.after),
        "held_out": {name: {"before": _distance(one), "after": _distance(two)} for name, (one, two) in c.folds.items()},
    }


def share_result(share: Share) -> dict[str, Any]:
    """What is closed of all data or of a channel; distances in standard deviations of noise and discrepancy."""
    return {
        "fraction": finite(share.fraction),
        "interval_95": None if share.nothing else list(share.interval),
        "nothing_to_close": share.nothing,
        "scaled_before": share.before,
        "scaled_after": share.after,
        "floor": share.floor,
    }


def _distance(d: Distance) -> dict[str, float | None]:
    return {"displacement_um": finite(d.displacement_um), "load_n": finite(d.load_n), "scaled": finite(d.scaled)}


def bond_area(bundle: Bundle) -> float:
    """2 r t (m²) of the bundle's lattice: f_max over it is a traction."""
    return 2 * bundle.model.radius * bundle.specimen.thickness


def parameters(fitted: Fitted, temperature: float, area: float) -> dict[str, Any]:
    """The two parameters and the energy of a bond over its area (m²), with intervals of the parameters."""
    f_max, delta_max = (float(x) for x in fitted.parameters)
    f_interval, delta_interval = fitted.parameter_interval(temperature=temperature).tolist()
    return {
        "f_max_n": f_max,
        "delta_max_m": delta_max,
        "bond_fracture_energy_j_per_m2": f_max * delta_max / area,
        "interval_95": {"f_max_n": f_interval, "delta_max_m": delta_interval},
    }


def bias(before: np.ndarray, after: np.ndarray) -> dict[str, float]:
    """By how much f_max, δ_max and their product lie off without the explanation, relative to with it."""
    f_max, delta_max = (float(x) for x in before / after - 1)
    product = float(np.prod(before / after) - 1)
    return {"f_max": f_max, "delta_max": delta_max, "bond_fracture_energy": product}


def sentence(d: Diagnosis) -> str:
    """The verdict in one line."""
    named = ", ".join(d.verdict.named)
    told = f"{d.verdict.kind}{': ' + named if named else ''} – {d.verdict.reason}"
    hidden = len(d.card.hidden) + len(d.untested)
    return (
        f"{told}; {hidden} of {len(library())} effects could not have been seen (d′ below {DETECTED:g}, or not tested)"
    )

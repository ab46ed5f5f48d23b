"""Several diagnoses by the keys of one result.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.core.errors import InputError
from pipeline.core.units import MM
from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.effects import effect, library
from pipeline.gap.score import NONE
from pipeline.gap.together import Together, typical
from pipeline.gap.transfer import Transfer
from pipeline.store.bundle import Bundle
from pipeline.study.diagnose_case import Case
from pipeline.study.diagnose_result import (
    bias,
    card_result,
    closure_result,
    excluded_not,
    finite,
    gate_result,
    own_warnings,
    remedies,
)
from pipeline.study.output import joined


def folders(bundles: Sequence[Bundle]) -> dict[str, Bundle]:
    """What results call the bundles: their own names, or those of their folders where names are alike.

    Raises
    ------
    InputError
        where neither tells them apart
    """
    for names in ([b.name for b in bundles], [b.folder.resolve().name for b in bundles]):
        if len(set(names)) == len(names):
            return dict(zip(names, bundles, strict=True))
    raise InputError("two bundles have the same name: change `name` in one experiment.toml, or give each bundle once")


def together_result(cases: Mapping[str, Case], joint: Together, warned: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """What result.json of several bundles holds, but for the time taken and the engine; `warned`: of each alone."""
    j, diagnoses = joint, [t.diagnosis for t in joint.tests]
    best = j.scored.ranked()[0]
    area = joint.tests[0].area
    before, after = (parameters_together(joint, label, area) for label in (NONE, best))
    return {
        "version": __version__,
        "command": "diagnose",
        "bundle": joined(list(cases)),
        "bundles": {t.name: _one(t.diagnosis, cases[t.name]) for t in j.tests},
        "bond_area_mm2": area / MM**2,
        "verdict": j.verdict.kind,
        "named": list(j.verdict.named),
        "reason": j.verdict.reason,
        "probability": dict(sorted(j.scored.probability.items(), key=lambda item: -item[1])),
        "log_bayes": dict(j.scored.log_bayes),
        "takes_part": {n: j.scored.part(n) for n in j.card.names},
        "temperature": j.scored.temperature,
        "set_90": j.scored.credible(),
        "equivalence_classes": [list(c) for c in j.card.classes],
        "cannot_exclude": excluded_not(j.scored, j.card, j.verdict, j.untested),
        "estimate": {n: estimate_together(joint, n) for n in j.card.names},
        "where": where_together(diagnoses),
        "closure": {label: closure_together(rows) for label, rows in _by_label(j.transfers).items()},
        "transfer": [transfer_result(t) for t in j.transfers],
        **card_result(j.card),
        "gate": gate_result(j.gate),
        "not_tested": dict(j.untested),
        "parameters_before": before,
        "parameters_after": after,
        "bias_removed": bias(*(np.array([p["f_max_n"], p["delta_max_m"]]) for p in (before, after))),
        "noise_bic": _summed([d.noise_bic for d in diagnoses]),
        "separate_by": remedies(j.scored, j.card, j.verdict, j.untested),
        "equivalents": {n: list(e.equivalents) for n, e in library().items() if e.equivalents},
        "warnings": [*warnings_together(cases), *own_warnings(j.card, False), *warnings_of_each(warned)],
        "remarks": remarks_together(cases),
        "simulations": sum(d.runs for d in diagnoses),
        "data": int(sum(d.data.target.size for d in diagnoses)),
    }


def _one(d: Diagnosis, case: Case) -> dict[str, Any]:
    """What one of the tests says by itself."""
    best = d.scored.ranked()[0]
    return {
        "verdict": d.verdict.kind,
        "named": list(d.verdict.named),
        "first": best,
        "probability": d.scored.probability[best],
        "geometry": case.bundle.specimen.geometry,
        "cmod_rate_mm_per_min": case.bundle.loading.cmod_rate_mm_per_min,
        "temperature_c": case.bundle.loading.temperature_c,
    }


def estimate_together(joint: Together, name: str) -> dict[str, Any]:
    """How large an effect is if it is the only one: the median of the tests, and what each says."""
    temperature, fits = joint.scored.temperature, [t.diagnosis.fits[name] for t in joint.tests]
    value, interval = typical(fits, temperature)
    each = {t.name: float(f.values(temperature)[0]) for t, f in zip(joint.tests, fits, strict=True)}
    return {"value": value, "unit": effect(name).magnitude.unit, "interval_95": list(interval), "each": each}


def parameters_together(joint: Together, label: str, area: float) -> dict[str, Any]:
    """Median of the parameters as tractions, per bond of this area (m²), and those of every test."""
    tests = joint.tests
    rows = np.array([t.diagnosis.fits[label].parameters * (area / t.area, 1.0) for t in tests])
    f_max, delta_max = (float(x) for x in np.median(rows, axis=0))
    return {
        "f_max_n": f_max,
        "delta_max_m": delta_max,
        "bond_fracture_energy_j_per_m2": f_max * delta_max / area,
        "each": {t.name: row.tolist() for t, row in zip(tests, rows, strict=True)},
    }


def where_together(diagnoses: Sequence[Diagnosis]) -> list[dict[str, Any]]:
    """Root mean squares over tests of every cell of the table of where."""
    rows: dict[tuple[str, ...], list[Any]] = {}
    for d in diagnoses:
        for cell in d.cells:
            rows.setdefault((cell.channel, cell.stage, cell.region, cell.mode, cell.unit), []).append(cell)
    found: list[dict[str, Any]] = []
    for (channel, stage, region, mode, unit), cells in rows.items():
        sizes = {k: float(np.sqrt(np.mean([getattr(c, k) ** 2 for c in cells]))) for k in ("rms", "z_noise", "z_gap")}
        found.append({"channel": channel, "stage": stage, "region": region, "mode": mode, "unit": unit, **sizes})
    total = sum(row["z_gap"] ** 2 for row in found)
    return sorted(({**row, "share": row["z_gap"] ** 2 / total} for row in found), key=lambda row: -row["z_gap"])


def _by_label(rows: Sequence[Transfer]) -> dict[str, list[Transfer]]:
    found: dict[str, list[Transfer]] = {}
    for row in rows:
        found.setdefault(row.label, []).append(row)
    return found


def transfer_result(t: Transfer) -> dict[str, Any]:
    """One transfer by its keys."""
    closed = closure_result(t.closure)
    del closed["held_out"]
    return {
        "explanation": t.label,
        "target": t.target,
        "sources": list(t.sources),
        "kind": t.kind,
        "carried": ["f_max", "delta_max", *t.carried],
        "refitted": list(t.refitted),
        **closed,
    }


def closure_together(rows: Sequence[Transfer]) -> dict[str, Any]:
    """Median closure of one explanation over the tests to which it was taken."""
    closed = [r.closure.whole for r in rows if not r.closure.nothing]
    bounds = np.median([c.interval for c in closed], axis=0) if closed else None
    distance = {
        when: {
            key: finite(_rms([getattr(getattr(r.closure, when), key) for r in rows]))
            for key in ("displacement_um", "load_n", "scaled")
        }
        for when in ("before", "after")
    }
    return {
        "fraction": float(np.median([c.fraction for c in closed])) if closed else None,
        "interval_95": None if bounds is None else bounds.tolist(),
        "nothing_to_close": not closed,
        **distance,
        "held_out": {f"{r.target} ({r.kind})": finite(r.closure.fraction) for r in rows},
    }


def _rms(values: Sequence[float]) -> float:
    known = np.array([v for v in values if np.isfinite(v)])
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def _summed(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    common = set.intersection(*(set(r) for r in rows))
    return {label: sum(r[label] for r in rows) for label in rows[0] if label in common}


def warnings_together(cases: Mapping[str, Case]) -> list[str]:
    """What must be known before the tests are read together."""
    bundles = [c.bundle for c in cases.values()]
    found = []
    for what, values in (
        ("temperatures", {b.loading.temperature_c for b in bundles}),
        ("[material]", {b.material.model_dump_json() for b in bundles}),
    ):
        if len(values) > 1:
            found.append(
                f"{what} differ: f_max and delta_max are carried from test to test as if the material were the same"
            )
    return found


def warnings_of_each(warned: Mapping[str, Sequence[str]]) -> list[str]:
    """What must be known of single tests, by name where not of all."""
    found: dict[str, list[str]] = {}
    for name, sentences in warned.items():
        for sentence in sentences:
            found.setdefault(sentence, []).append(name)
    return [told if len(names) == len(warned) else f"{', '.join(names)}: {told}" for told, names in found.items()]


def remarks_together(cases: Mapping[str, Case]) -> list[str]:
    """What was assumed, of each test by its name."""
    return [f"{name}: {remark}" for name, case in cases.items() for remark in case.look.remarks]


def sentence_together(joint: Together) -> str:
    """The verdict in one line, and in one more how far it carries."""
    named = ", ".join(joint.verdict.named)
    told = f"{joint.verdict.kind}{': ' + named if named else ''} – {joint.verdict.reason} ({len(joint.tests)} tests)"
    lines = [f"{label}: {_carried(rows)}" for label, rows in _by_label(joint.transfers).items()]
    return "\n".join([told, *lines[:2]])


def _carried(rows: Sequence[Transfer]) -> str:
    closed = [r.closure.fraction for r in rows if not r.closure.nothing]
    if not closed:
        return "nothing to close on the other tests"
    low, high = min(closed), max(closed)
    return (
        f"fitted to the other tests it closes {low:.0%} to {high:.0%} of the gap of {len(closed)} of {len(rows)} tests"
    )

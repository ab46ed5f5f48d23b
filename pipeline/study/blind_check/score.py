"""How verdicts are scored against the truth; a diagnosis that failed counts as a miss."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.gap.effects import effect, library
from pipeline.gap.identifiability import DETECTED
from pipeline.gap.score import NONE, UNLISTED
from pipeline.gap.verdict import OUTSIDE

SURE, VISIBLE = 0.8, 5.0
Z = 1.959964  # of 95 %
BINS = 10
STEPS = (0.5, 1.0, 2.0, 4.0)  # detection limits between which cases are counted together
STEP_NAMES = ("below 0.5", "0.5 to 1", "1 to 2", "2 to 4", "4 and more")
FAR_OUTSIDE = 4.95  # detection limits: those asked for are 5, to three digits


@dataclass(frozen=True)
class Scored:
    """One case: its truth, what was said, and what follows.

    Parameters
    ----------
    name, specimen, kind : str
    truth : label; effects joined by " + ", "none", or "outside the library"
    top : the most probable label, "outside the library" where that is the verdict, "failed" where there is no result
    probability : float; of the top label
    result : the diagnosis
    row : of the truth table
    """

    name: str
    specimen: str
    kind: str
    truth: str
    top: str
    probability: float
    result: Mapping[str, Any]
    row: Mapping[str, Any]

    @property
    def right(self) -> bool:
        return self.top == self.truth

    @property
    def right_class(self) -> bool:
        """The top label shares a class with the truth, effect for effect."""
        classes = self.result.get("equivalence_classes", [])

        def mates(name: str) -> frozenset[str]:
            return frozenset(next((c for c in classes if name in c), [name]))

        return {mates(n) for n in self.top.split(" + ")} == {mates(n) for n in self.truth.split(" + ")}

    @property
    def covered(self) -> bool:
        return self.truth in [label_of(entry.split(" + ")) for entry in self.result.get("set_90", [])]

    @property
    def multiple(self) -> float:
        """The true value in detection limits of the diagnosis's own card, of the smallest where there are several.

        Where no plausible size is detected d′ counts, in proportion to the value; where the card lacks the effect, what
        the truth table says.
        """
        limits, found = self.result.get("detection_limit", {}), []
        for name, value in self.row.get("effects", {}).items():
            row = limits.get(name)
            if row is None:
                found.append(float(self.row["multiple"]))
            elif row.get("value"):
                found.append(abs(value) / row["value"])
            else:
                found.append(row.get("d_prime_at_most", 0.0) / DETECTED * abs(value) / effect(name).magnitude.high)
        return min(found, default=0.0)

    @property
    def d_prime(self) -> float:
        """d′ of the true value, by the diagnosis's own card; 0 where it could not judge the effect."""
        judged = set(self.row.get("effects", {})) <= set(self.result.get("detection_limit", {}))
        return DETECTED * self.multiple if judged else 0.0


def label_of(names: Sequence[str]) -> str:
    """The label of one effect, a pair, or none."""
    return " + ".join(sorted(names)) or NONE


def paired(truth: Mapping[str, Any], verdicts: Mapping[str, Any]) -> list[Scored]:
    """Every case of the truth table with its verdict."""
    return [_one(name, row, verdicts.get(name)) for name, row in sorted(truth.items())]


def together(truth: Mapping[str, Any], verdicts: Mapping[str, Any]) -> list[Scored]:
    """Every set of replicates with the verdict of its members together, each a specimen of its own."""
    sets: dict[str, Mapping[str, Any]] = {}
    for _, row in sorted(truth.items()):
        if row.get("replicates"):
            sets.setdefault(str(row["replicates"]), row)
    return [_one(name, {**row, "specimen": name}, verdicts.get(name)) for name, row in sorted(sets.items())]


def scores_together(truth: Mapping[str, Any], verdicts: Mapping[str, Any]) -> dict[str, Any]:
    """Scores of sets of replicates, by the same keys as those of single tests."""
    every = together(truth, verdicts)
    single, free = ([c for c in every if c.kind == kind] for kind in ("effect", "none"))
    return {
        "sets": len(every),
        "failed": sum(not c.result for c in every),
        "top1": share(single, lambda c: c.right),
        "class_top1": share(single, lambda c: c.right_class),
        "false_alarm": share(free, named_surely),
        "misses": [_miss(c) for c in every if not c.right],
    }


def _one(name: str, row: Mapping[str, Any], result: Mapping[str, Any] | None) -> Scored:
    known = UNLISTED if row["kind"] == "outside" else label_of(list(row["effects"]))
    common = {"name": name, "specimen": row["specimen"], "kind": row["kind"], "truth": known, "row": row}
    if result is None:
        return Scored(top="failed", probability=0.0, result={}, **common)
    chances = {label_of(n.split(" + ")): p for n, p in result.get("probability", {}).items()}
    top = max(sorted(chances), key=lambda n: chances[n], default="failed")
    p = float(chances.get(top, 0.0))
    if result.get("verdict") == OUTSIDE:
        top = UNLISTED
    return Scored(top=top, probability=p, result=result, **common)


def wilson(successes: float, trials: float) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927); (0, 1) without trials."""
    if trials <= 0:
        return 0.0, 1.0
    share, spread = successes / trials, Z**2 / trials
    middle = (share + spread / 2) / (1 + spread)
    half = Z / (1 + spread) * np.sqrt(share * (1 - share) / trials + spread / (4 * trials))
    return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))


def design_effect(hits: np.ndarray, cluster: np.ndarray) -> float:
    """By how much cases of one specimen, being alike, make fewer of many: 1 + (m − 1) ρ, ρ from an analysis of variance
    (Donner and Klar 2000), never below 1."""
    names, index = np.unique(cluster, return_inverse=True)
    k, n = names.size, hits.size
    if k < 2 or n <= k:
        return 1.0
    size = np.bincount(index)
    mean = np.bincount(index, hits) / size
    between = float(size @ (mean - hits.mean()) ** 2) / (k - 1)
    within = float(np.sum((hits - mean[index]) ** 2)) / (n - k)
    typical = (n - float(size @ size) / n) / (k - 1)
    total = between + (typical - 1) * within
    rho = max((between - within) / total, 0.0) if total > 0 else 0.0
    return 1 + (float(size @ size) / n - 1) * rho


def share(cases: Sequence[Scored], hit: Callable[[Scored], bool]) -> dict[str, Any]:
    """Share of hits with its Wilson interval, clustered by specimen; null without cases."""
    if not cases:
        return {"value": None, "interval_95": [0.0, 1.0], "cases": 0}
    hits = np.array([float(hit(c)) for c in cases])
    effective = hits.size / design_effect(hits, np.array([c.specimen for c in cases]))
    low, high = wilson(float(hits.mean()) * effective, effective)
    return {"value": float(hits.mean()), "interval_95": [low, high], "cases": hits.size}


def named_surely(case: Scored) -> bool:
    """An effect or a class is named at 0.8 or more."""
    return case.result.get("verdict") in ("cause", "class") and bool(case.result.get("named")) and _sure(case) >= SURE


def called_outside(case: Scored) -> bool:
    """The verdict is that the library does not explain the test."""
    return bool(case.result.get("verdict") == OUTSIDE)


def _sure(case: Scored) -> float:
    """Probability of what is named: of a class, all its members together."""
    named = set(case.result.get("named", []))
    chances = case.result.get("probability", {})
    return float(sum(p for n, p in chances.items() if set(n.split(" + ")) <= named))


def calibration(cases: Sequence[Scored], even: bool = False) -> tuple[float | None, list[dict[str, Any]]]:
    """Expected calibration error of the top label, and the reliability diagram's bins.

    Parameters
    ----------
    cases : sequence of Scored
    even : bool; those with and without an effect count alike in the error, as the prior of every diagnosis has it
    """
    if not cases:
        return None, []
    p = np.array([c.probability for c in cases])
    right = np.array([float(c.right) for c in cases])
    none = np.array([c.kind == "none" for c in cases])
    weight = np.where(none, 1 / max(none.sum(), 1), 1 / max((~none).sum(), 1)) if even else np.ones(len(cases))
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    bins = [m for m in (place == k for k in range(BINS)) if m.any()]
    rows: list[dict[str, Any]] = [
        {
            "stated": float(p[m].mean()),
            "achieved": float(right[m].mean()),
            "cases": float(m.sum()),
            "interval_95": list(wilson(float(right[m].sum()), float(m.sum()))),
        }
        for m in bins
    ]
    return float(sum(abs(weight[m] @ (p - right)[m]) for m in bins) / weight.sum()), rows


def confusion(cases: Sequence[Scored]) -> dict[str, dict[str, int]]:
    """Truth → top label → how often."""
    found: dict[str, dict[str, int]] = {}
    for case in cases:
        row = found.setdefault(case.truth, {})
        row[case.top] = row.get(case.top, 0) + 1
    return {t: dict(sorted(row.items())) for t, row in sorted(found.items())}


def closure_ratio(case: Scored) -> float | None:
    """Closure of what was chosen over that of the true effect; null where one was not computed, or the truth closes
    nothing."""
    closure = {label_of(n.split(" + ")): row.get("fraction") for n, row in case.result.get("closure", {}).items()}
    chosen, oracle = closure.get(case.top), closure.get(case.truth)
    return float(chosen / oracle) if chosen is not None and oracle is not None and oracle > 0 else None


def largest_drop(case: Scored) -> str:
    """The label after which the fields are nearest, of those whose closure was computed; what a naive reader takes."""
    left = {
        label_of(n.split(" + ")): row["after"].get("displacement_um")
        for n, row in case.result.get("closure", {}).items()
    }
    known = {n: v for n, v in left.items() if v is not None}
    return min(sorted(known), key=lambda n: known[n], default=NONE)


def by_noise(case: Scored) -> str | None:
    """The label of the best BIC against white noise alone, where the diagnosis states it (`noise_bic`)."""
    bic = {label_of(n.split(" + ")): v for n, v in case.result.get("noise_bic", {}).items()}
    return min(sorted(bic), key=lambda n: bic[n]) if bic else None


def baselines(cases: Sequence[Scored]) -> dict[str, Any]:
    """Top-1 of simpler ways to choose."""
    with_bic = [c for c in cases if by_noise(c) is not None]
    return {
        "noise_bic": {"top1": share(with_bic, lambda c: by_noise(c) == c.truth)},
        "largest_rms_drop": {"top1": share([c for c in cases if c.result], lambda c: largest_drop(c) == c.truth)},
        "shuffled_truth": {"top1": shuffled(cases)},
        "random": {"top1": {"value": 1 / (len(library()) + 1), "interval_95": None, "cases": len(cases)}},
    }


def shuffled(cases: Sequence[Scored], seed: int = 0) -> dict[str, Any]:
    """Top-1 of these verdicts against the truths in random order, and where 95 % of a thousand orders lie."""
    if not cases:
        return {"value": None, "interval_95": [0.0, 1.0], "cases": 0}
    rng = np.random.default_rng(seed)
    truth, top = np.array([c.truth for c in cases]), np.array([c.top for c in cases])
    hits = [float(np.mean(rng.permutation(truth) == top)) for _ in range(1000)]
    low, high = np.percentile(hits, [2.5, 97.5]).tolist()
    return {"value": float(np.mean(hits)), "interval_95": [low, high], "cases": len(cases)}


def times(taken: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Seconds of every diagnosis, on the clock and of processors, and in total."""
    total = {key: float(sum(row[key] for row in taken.values())) for key in ("seconds", "processor_seconds")}
    return {"total": total, "cases": {name: dict(row) for name, row in sorted(taken.items())}}


def scores(truth: Mapping[str, Any], verdicts: Mapping[str, Any]) -> dict[str, Any]:
    """All scores of a check by their keys."""
    every = paired(truth, verdicts)
    single = [c for c in every if c.kind == "effect"]
    free = [c for c in every if c.kind == "none"]
    pairs = [c for c in every if c.kind == "pair"]
    outside = [c for c in every if c.kind == "outside"]
    inside = single + free
    visible = [c for c in single if c.d_prime >= VISIBLE]
    kinds = {n: e.kind for n, e in library().items()}
    clear = [c for c in single if kinds.get(c.truth) == "measurement" and c.multiple >= 2]
    clear_outside = [c for c in outside if not c.row.get("effects") or c.multiple >= FAR_OUTSIDE]
    physics = [c for c in visible if kinds.get(c.truth) == "physics"]
    ece, bins = calibration(inside)
    ratios = [r for r in (closure_ratio(c) for c in visible) if r is not None]
    sizes = [float(len(c.result["set_90"])) for c in inside if c.result.get("set_90") is not None]
    return {
        "cases": len(every),
        "failed": sum(not c.result for c in every),
        "false_alarm": share(free, named_surely),
        "free_called_outside": share(free, called_outside),
        "top1": share(single, lambda c: c.right),
        "class_top1": share(single, lambda c: c.right_class),
        "measurement_top1_at_2_limits": share(clear, lambda c: c.right),
        "physics_class_top1_at_d_prime_5": share(physics, lambda c: c.right_class),
        "coverage_90": share(inside, lambda c: c.covered),
        "set_size": {"value": _mean(sizes), "interval_95": _bootstrap(sizes), "cases": len(sizes)},
        "ece": {"value": ece, "interval_95": _ece_interval(inside), "cases": len(inside)},
        "ece_even": {"value": calibration(inside, even=True)[0], "interval_95": None, "cases": len(inside)},
        "reliability": bins,
        "outside_recall": share(outside, called_outside),
        "outside_recall_at_5_limits": share(clear_outside, called_outside),
        "confident_wrong_outside": share(outside, named_surely),
        "pairs_top1": share(pairs, lambda c: c.right),
        "pairs_one_named": share(pairs, lambda c: bool(set(c.top.split(" + ")) & set(c.truth.split(" + ")))),
        "closure_over_oracle": {
            "value": float(np.median(ratios)) if ratios else None,
            "interval_95": _bootstrap(ratios, np.median),
            "cases": len(ratios),
        },
        "parameter_bias": bias(every),
        "detection_limits": limits(single),
        "baselines": baselines(inside),
        "confusion": confusion(every),
        "misses": [_miss(c) for c in every if not c.right and not (c.kind == "none" and c.top == NONE)],
    }


def bias(cases: Sequence[Scored]) -> dict[str, Any]:
    """Median error of the parameters against the truth, as the model is and with the best explanation."""
    found: dict[str, Any] = {}
    for when in ("parameters_before", "parameters_after"):
        for key in ("f_max_n", "delta_max_m"):
            errors = [abs(c.result[when][key] / c.row[key] - 1) for c in cases if when in c.result and key in c.row]
            found.setdefault(when, {})[key] = {"median_error": float(np.median(errors)) if errors else None}
    return found


def limits(cases: Sequence[Scored]) -> dict[str, Any]:
    """Per effect: share named right, by class, and number of cases, by multiple of the card's detection limit."""
    found: dict[str, dict[str, list[float]]] = {}
    for case in cases:
        found.setdefault(case.truth, {}).setdefault(step_of(case.multiple), []).append(float(case.right_class))
    return {
        n: {m: {"right": float(np.mean(rows[m])), "cases": len(rows[m])} for m in STEP_NAMES if m in rows}
        for n, rows in sorted(found.items())
    }


def step_of(multiple: float) -> str:
    """Between which multiples a size lies."""
    return STEP_NAMES[int(np.searchsorted(STEPS, multiple, side="right"))]


def _miss(case: Scored) -> dict[str, Any]:
    return {
        "case": case.name,
        "truth": case.truth,
        "kind": case.kind,
        "effects": dict(case.row.get("effects", {})),
        "multiple": case.multiple,
        "said": case.top,
        "verdict": case.result.get("verdict", "failed"),
        "probability": case.probability,
        "in_set_90": case.covered,
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _bootstrap(values: Sequence[float], of: Callable[..., Any] = np.mean, seed: int = 0) -> list[float] | None:
    """Interval of 2.5 and 97.5 % over a thousand redrawn samples."""
    if len(values) < 2:
        return None
    rng, data = np.random.default_rng(seed), np.asarray(values)
    drawn = [of(rng.choice(data, data.size)) for _ in range(1000)]
    return [float(v) for v in np.percentile(drawn, [2.5, 97.5])]


def _ece_interval(cases: Sequence[Scored], seed: int = 0) -> list[float] | None:
    if len(cases) < 2:
        return None
    rng = np.random.default_rng(seed)
    drawn = [calibration([cases[k] for k in rng.integers(0, len(cases), len(cases))])[0] or 0.0 for _ in range(500)]
    return [float(v) for v in np.percentile(drawn, [2.5, 97.5])]

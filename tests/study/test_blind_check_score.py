"""Scores of a blind check against counts by hand, and its goals."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.truth_table import row

from pipeline.gap.effects import library
from pipeline.study.blind_check.goals import GOALS, goals_result
from pipeline.study.blind_check.score import (
    Scored,
    calibration,
    closure_ratio,
    design_effect,
    paired,
    scores,
    step_of,
    wilson,
)

EFFECTS = sorted(library())


def said(label: str, p: float = 0.9, verdict: str | None = None, **more: object) -> dict:
    rest = {"none": 1 - p} if label != "none" else {"creep": 1 - p}
    return {
        "verdict": verdict or ("none needed" if label == "none" else "cause"),
        "named": [] if label == "none" else label.split(" + "),
        "probability": {label: p, **rest}, "set_90": [label], "equivalence_classes": [], **more,
    }  # fmt: skip


def test_sizes_are_counted_in_the_limits_of_the_diagnosis_itself():
    card = {"modulus": {"value": 0.2, "d_prime_at_most": 7.5}, "creep": {"value": None, "d_prime_at_most": 1.5}}

    def case(effects: dict[str, float], **more: object) -> Scored:
        [found] = paired({"1": row(None, kind="effect") | {"effects": effects}}, {"1": said("none", **more)})
        return found

    assert case({"modulus": -0.5}, detection_limit=card).multiple == pytest.approx(2.5)  # row() says 2
    assert case({"creep": 1.0}, detection_limit=card).multiple == pytest.approx(0.25)  # half of what gives d′ = 1.5
    assert case({"modulus": 0.5, "creep": 2.0}, detection_limit=card).multiple == pytest.approx(0.5)
    assert case({"load_gain": 0.1}, detection_limit=card).multiple == 2.0  # the card lacks it: what the table says
    assert case({"modulus": 0.4}, detection_limit=card).d_prime == pytest.approx(6.0)
    assert case({"load_gain": 0.1}, detection_limit=card).d_prime == 0.0
    assert [step_of(x) for x in (0.2, 0.5, 1.0, 3.9, 4.0)] == [
        "below 0.5",
        "0.5 to 1",
        "1 to 2",
        "2 to 4",
        "4 and more",
    ]


def test_goals_say_hit_or_miss():
    result = {g.key: {"value": 0.9, "interval_95": None, "cases": 4} for g in GOALS if "." not in g.key}
    result["together"] = {k: {"value": None} for k in ("class_top1", "false_alarm", "top1")}
    met = {key: found["met"] for key, found in goals_result(result).items()}
    assert met["measurement_top1_at_2_limits"] is True  # 0.90 asked for
    assert met["false_alarm"] is False  # at most 0.10
    assert met["coverage_90"] is True  # 0.85 to 0.95
    assert met["together.class_top1"] is None  # no set
    assert "top1" not in met  # no goal was set


def test_wilsons_interval():
    # by hand for 7 of 10: (0.7 + 0.19207)/1.38415 ± 1.95996/1.38415 · √(0.021 + 0.0096036)
    assert wilson(7, 10) == pytest.approx((0.39678, 0.89221), abs=2e-5)  # rounded by hand
    assert wilson(0, 0) == (0.0, 1.0)


def test_cases_of_one_specimen_count_less():
    hits = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    assert design_effect(hits, np.array(list("aaabbb"))) == pytest.approx(3.0)  # ρ = 1: two clusters, not six cases
    assert design_effect(hits, np.array(list("abcdef"))) == 1.0


def test_scores_against_a_hand_count():
    truth = {
        "1": row("modulus"), "2": row("creep"), "3": row("load_gain"), "4": row(None), "5": row(None),
        "6": row("creep", kind="outside"), "7": row("modulus", specimen="b"),
    }  # fmt: skip
    verdicts = {
        "1": said("modulus", 0.9), "2": said("modulus", 0.6, equivalence_classes=[["creep", "modulus"]]),
        "3": said("load_gain", 0.8), "4": said("none", 0.7), "5": said("creep", 0.95),
        "6": said("modulus", 0.9, verdict="outside the library", named=[]),
    }  # fmt: skip
    found = scores(truth, verdicts)
    assert found["cases"] == 7
    assert found["failed"] == 1
    assert found["top1"]["value"] == 2 / 4
    assert found["class_top1"]["value"] == 3 / 4
    assert found["false_alarm"]["value"] == 1 / 2
    assert found["outside_recall"]["value"] == 1.0
    assert found["coverage_90"]["value"] == 3 / 6
    assert found["confusion"]["creep"] == {"modulus": 1}
    assert [m["case"] for m in found["misses"]] == ["2", "5", "7"]
    # bins by hand: 0.9 → 1 of 2 right (0.9, 0.95), 0.6 → 0 of 1, 0.8 → 1 of 1, 0.7 → 1 of 1, 0.0 → 0 of 1
    assert found["ece"]["value"] == pytest.approx((2 * abs(0.925 - 0.5) + 0.6 + 0.2 + 0.3 + 0.0) / 6)


def test_closure_is_compared_where_the_truth_closes_anything():
    def ratio(said_there: float | None, true_there: float | None) -> float | None:
        closed = {"creep": {"fraction": said_there}, "modulus": {"fraction": true_there}}
        [case] = paired({"1": row("modulus")}, {"1": said("creep", closure=closed)})
        return closure_ratio(case)

    assert ratio(0.6, 0.8) == pytest.approx(0.75)
    assert [ratio(0.6, None), ratio(None, 0.8), ratio(0.6, 0.0), ratio(0.6, -0.2)] == [None] * 4


def test_calibration_of_what_is_always_right():
    every = paired({"1": row("modulus"), "2": row("creep")}, {"1": said("modulus", 1.0), "2": said("creep", 1.0)})
    assert calibration(every)[0] == pytest.approx(0.0)


def test_calibration_where_one_of_ten_lacks_an_effect_as_half_of_the_priors_do():
    """Always said: none, 0.6. Of nine effects and one test without, that is 0.5 too much; half and half, 0.1."""
    truths = {str(k): row("modulus", str(k)) for k in range(9)} | {"9": row(None, "9")}
    every = paired(truths, {name: said("none", 0.6) for name in truths})
    assert calibration(every)[0] == pytest.approx(0.5)
    assert calibration(every, even=True)[0] == pytest.approx(0.1)


def test_against_shuffled_truth_a_right_diagnosis_is_at_chance():
    labels = [name for name in EFFECTS for _ in range(10)]
    verdicts = {str(k): said(name) for k, name in enumerate(labels)}
    right = scores({str(k): row(n, str(k)) for k, n in enumerate(labels)}, verdicts)
    shuffled = np.random.default_rng(0).permutation(labels).tolist()
    wrong = scores({str(k): row(n, str(k)) for k, n in enumerate(shuffled)}, verdicts)
    assert right["top1"]["value"] == 1.0
    low, high = wrong["top1"]["interval_95"]
    assert low <= 1 / len(EFFECTS) <= high
    assert wrong["top1"]["value"] < 0.12  # chance is 0.05; four standard deviations of 200 cases
    chance = right["baselines"]["shuffled_truth"]["top1"]
    assert chance["value"] == pytest.approx(1 / len(EFFECTS), abs=0.005)  # mean of 1000 orders: ± 0.015/√1000
    assert chance["interval_95"][0] <= wrong["top1"]["value"] <= chance["interval_95"][1]
    assert right["top1"]["value"] > 5 * chance["interval_95"][1]

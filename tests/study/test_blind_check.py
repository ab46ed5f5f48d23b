"""Seals, scores and the guarded run of the blind check; engine C's bundles."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError, InputError, StoreError
from pipeline.gap.effects import library
from pipeline.store.bundle import read_bundle
from pipeline.study.blind_check import cases as drawing
from pipeline.study.blind_check import make as making
from pipeline.study.blind_check.guard import Guard
from pipeline.study.blind_check.opening import open_check
from pipeline.study.blind_check.run import replicates, run
from pipeline.study.blind_check.score import calibration, closure_ratio, design_effect, paired, scores, wilson
from pipeline.study.blind_check.seal import SEAL, VERDICTS, lock, salted, unlock, vault_of, write_seal

FAKE = "study.fake_diagnosis:diagnose"
EFFECTS = sorted(library())


def row(effect: str | None = None, specimen: str = "a", kind: str | None = None, **more: object) -> dict:
    effects = {effect: 1.0} if effect else {}
    return {
        "specimen": specimen, "kind": kind or ("effect" if effect else "none"), "effects": effects,
        "f_max_n": 100.0, "delta_max_m": 1e-4, "multiple": 2.0, **more,
    }  # fmt: skip


def said(label: str, p: float = 0.9, verdict: str | None = None, **more: object) -> dict:
    rest = {"none": 1 - p} if label != "none" else {"creep": 1 - p}
    return {
        "verdict": verdict or ("none needed" if label == "none" else "cause"),
        "named": [] if label == "none" else label.split(" + "),
        "probability": {label: p, **rest}, "set_90": [label], "equivalence_classes": [], **more,
    }  # fmt: skip


@pytest.fixture
def sealed(tmp_path, monkeypatch):
    """A check of another program: three bundles of hints, a truth table in the open, sealed."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[1]))
    out = tmp_path / "check"
    names = {"case-0": "modulus", "case-1": "creep", "case-2": "load_gain"}
    for name, effect in names.items():
        (out / "bundles" / name).mkdir(parents=True)
        (out / "bundles" / name / "hint.json").write_text(json.dumps({"says": effect}))
    truth = salted({"cases": {name: row(effect) for name, effect in names.items()}})
    (tmp_path / "truth.json").write_bytes(truth)
    (out / "plan.json").write_text(json.dumps({"case-1": {"without": ["modulus", "creep"]}}))
    write_seal(out, truth, None, {})
    return out


def hint(out: Path, case: str, **more: str) -> None:
    """Change a hint and seal again."""
    path = out / "bundles" / case / "hint.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | more))
    write_seal(out, (out.parent / "truth.json").read_bytes(), None, {})


def flip(path: Path, at: int = 3) -> None:
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


def test_a_right_diagnosis_is_scored_right(sealed):
    run(sealed, diagnose=FAKE, workers=2)
    told = open_check(sealed, truth=sealed.parent / "truth.json")
    result = json.loads((sealed / "result.json").read_text())
    assert result["top1"]["value"] == 1.0
    assert result["seals_ok"] is True
    assert result["misses"] == []
    assert sorted(result["run_times"]["cases"]) == ["case-0", "case-1", "case-2"]
    assert 0 < result["run_times"]["total"]["processor_seconds"] < 600  # three interpreters, not none and not hours
    assert (sealed / "reliability.png").read_bytes().startswith(b"\x89PNG")
    assert "seals hold; 3 cases, 0 failed" in told
    assert "<h1" in (sealed / "report.html").read_text()
    assert "case-1 modulus creep" in (sealed / "calls.txt").read_text()


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("check/bundles/case-1/hint.json", "case-1/hint.json was changed"),
        ("check/verdicts.json", "verdicts.json was changed"),
        ("truth.json", "truth table is not the one"),
        ("check/plan.json", "plan.json was changed"),
    ],
)
def test_one_flipped_byte_is_caught(sealed, file, told):
    run(sealed, diagnose=FAKE)
    flip(sealed.parent / file)
    with pytest.raises(StoreError, match=told):
        open_check(sealed, truth=sealed.parent / "truth.json")
    assert not (sealed / "result.json").exists()


def test_a_bundle_changed_before_the_run_is_not_diagnosed(sealed):
    flip(sealed / "bundles" / "case-0" / "hint.json")
    with pytest.raises(StoreError, match="not those that were sealed"):
        run(sealed, diagnose=FAKE)


def test_replicates_are_diagnosed_together_and_leave_their_own_verdicts(sealed):
    plan = {"case-0": {"replicates": "set-0"}, "case-2": {"replicates": "set-0"}, "case-1": {"without": ["creep"]}}
    (sealed / "plan.json").write_text(json.dumps(plan))
    rows = {"case-0": row("modulus", replicates="set-0"), "case-1": row("creep"),
            "case-2": row("modulus", "b", replicates="set-0")}  # fmt: skip
    truth = sealed.parent / "truth.json"
    truth.write_bytes(salted({"cases": rows}))
    hint(sealed, "case-2", says="modulus")
    assert "4 verdicts sealed" in run(sealed, diagnose=FAKE, workers=2)
    calls = [line.split()[0] for line in (sealed / "calls.txt").read_text().splitlines()]
    assert sorted(calls) == ["case-0+case-2", "case-1"]  # none of the set is diagnosed again by itself
    open_check(sealed, truth=truth)
    result = json.loads((sealed / "result.json").read_text())
    assert result["top1"]["value"] == 1.0
    assert result["together"]["sets"] == 1
    assert result["together"]["class_top1"]["value"] == 1.0
    assert "set-0" in result["run_times"]["cases"]


def test_members_of_a_set_that_fails_are_diagnosed_by_themselves(sealed):
    plan = {"case-0": {"replicates": "set-0"}, "case-2": {"replicates": "set-0"}}
    (sealed / "plan.json").write_text(json.dumps(plan))
    hint(sealed, "case-0", wait_for="never")
    assert "2 verdicts sealed; 2 failed: case-0, set-0" in run(sealed, diagnose=FAKE)


def test_sets_with_two_libraries_are_refused():
    with pytest.raises(StoreError, match="different libraries"):
        replicates({"a": {"replicates": "s", "without": ["creep"]}, "b": {"replicates": "s"}}, ["a", "b"])
    with pytest.raises(StoreError, match="a bundle's name"):
        replicates({"a": {"replicates": "b"}, "b": {"replicates": "b"}}, ["a", "b"])


@pytest.mark.parametrize("file", ["truth.fernet", "key"])
def test_a_flipped_byte_of_the_locked_truth_is_caught(tmp_path, file):
    lock(b"the truth", tmp_path)
    assert unlock(tmp_path) == b"the truth"
    flip(tmp_path / file)
    with pytest.raises(StoreError, match="changed after it was sealed"):
        unlock(tmp_path)


def test_a_stopped_run_goes_on_and_repeats_nothing(sealed):
    hint(sealed, "case-1", wait_for="go")
    assert "1 failed: case-1" in run(sealed, diagnose=FAKE)
    (sealed / "go").touch()
    assert "3 verdicts sealed" in run(sealed, diagnose=FAKE)
    calls = [line.split()[0] for line in (sealed / "calls.txt").read_text().splitlines()]
    assert calls == ["case-0", "case-1", "case-2", "case-1"]


def test_verdicts_after_the_opening_are_refused(sealed):
    run(sealed, diagnose=FAKE)
    open_check(sealed, truth=sealed.parent / "truth.json")
    with pytest.raises(InputError, match="was opened"):
        run(sealed, diagnose=FAKE)


def test_a_diagnosis_cannot_reach_out(sealed):
    vault = vault_of(sealed)
    vault.mkdir()
    (vault / "key").write_text("k")
    hint(sealed, "case-0", open=str(vault / "key"))
    hint(sealed, "case-1", open=str(sealed.parent / "truth.json"))
    hint(sealed, "case-2", write=str(sealed.parent / "smuggled"))
    assert "3 failed" in run(sealed, diagnose=FAKE)
    failed = json.loads((sealed / VERDICTS).read_text())["failed"]
    assert all("a blind diagnosis must not open" in why for why in failed.values())
    assert not (sealed.parent / "smuggled").exists()


def test_the_guard_never_opens_the_vault_even_below_the_program(tmp_path):
    guard = Guard(tmp_path / "check")
    guard.program = (str(tmp_path),)
    assert guard.allowed(str(tmp_path / "module.py"), writes=False)
    assert not guard.allowed(str(tmp_path / "module.py"), writes=True)
    assert not guard.allowed(str(tmp_path / "check.vault" / "key"), writes=False)


@pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed")
def test_the_kernel_saw_no_path_outside_opened(sealed):
    trace = sealed / "trace"
    run(sealed, diagnose=FAKE, prefix=("strace", "-f", "-qq", "-e", "trace=open,openat,creat", "-o", str(trace)))
    guard = Guard(sealed)
    lines = [line for line in trace.read_text().splitlines() if " = -1 " not in line]
    opened = [(found[1], line) for line in lines if (found := re.search(r'"([^"]+)"', line))]
    assert len(opened) > 30  # the trace holds the interpreter's own start
    for path, line in opened:
        real = str((sealed / path).resolve())
        assert guard.allowed(real, any(w in line for w in ("O_WRONLY", "O_RDWR", "O_CREAT"))), line


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


def test_the_cases_of_a_full_check():
    limits = drawing.limits_of(None)
    found = drawing.drawn_cases("full", limits, np.random.default_rng(0))
    assert sum(c.images for c in found) * 5 >= len(found)
    for name in EFFECTS:
        size = library()[name].magnitude
        mine = [c for c in found if c.kind == "effect" and list(c.effects) == [name]]
        assert len(mine) == 7 + 4  # four multiples at two noise levels, one of these on four specimens
        kinds = {(round(c.multiple, 6), c.noise) for c in mine}
        assert len(kinds) == 8 or min(4 * limits[name], size.high) < 4 * limits[name]  # fewer where the cap is met
        assert all(size.low <= c.effects[name] <= size.high for c in mine)
        assert sum(c.kind == "outside" and name in c.effects and name in c.without for c in found) == 1
    assert all(not set(c.effects) & set(c.without) for c in found if c.kind != "outside")
    assert sum(c.kind == "none" and bool(c.without) for c in found) > 0  # a short library betrays nothing
    assert sum(c.kind == "none" for c in found) >= 20
    assert sum(c.stranger is not None for c in found) >= 10


def test_a_test_that_cannot_be_followed_is_broken_on_another_mesh(monkeypatch):
    tried = []
    monkeypatch.setattr(making, "setup_of", lambda sample, rng: tried.append(rng.integers(2**32)) or len(tried))

    def follow(setup, cmod_max):
        if setup < 3:
            raise ConvergenceError("it snaps back")
        return "path"

    monkeypatch.setattr(making, "break_triangles", follow)
    assert making.broken_on_some_mesh(None, [1, 7, 0], 1e-3) == (3, "path")
    assert len(set(tried)) == 3  # every mesh is another
    monkeypatch.setattr(making, "break_triangles", lambda *_: follow(0, 0))
    with pytest.raises(ConvergenceError, match="snaps back"):
        making.broken_on_some_mesh(None, [1, 7, 0], 1e-3)


def test_a_check_goes_on_only_as_it_was_begun(tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(making, "draw", stop)
    for _ in range(2):  # the same again gets as far
        with pytest.raises(KeyboardInterrupt):
            making.make(tmp_path / "check", seed=4)
    with pytest.raises(InputError, match="begun with another"):
        making.make(tmp_path / "check", seed=5)
    assert not list((tmp_path / "check").rglob("begun.json"))  # the seed lies in the vault


def test_the_small_check_has_twelve_cases():
    found = drawing.drawn_cases("small", drawing.limits_of(None), np.random.default_rng(1))
    assert len(found) == 12
    assert sum(c.images for c in found) == 3
    assert {c.kind for c in found} == {"none", "effect", "pair", "outside"}


def test_detection_limits_of_a_diagnosis_scale_the_effects(tmp_path):
    file = tmp_path / "result.json"
    file.write_text(json.dumps({"detection_limit": {"load_gain": {"value": 0.01}, "creep": {"value": None}}}))
    limits = drawing.limits_of(file)
    assert limits["load_gain"] == 0.01
    assert limits["creep"] == drawing.limits_of(None)["creep"]
    assert drawing.sized("load_gain", 4.0, limits, -1.0) == pytest.approx((-0.04, 4.0))
    assert drawing.sized("load_gain", 40.0, limits, 1.0) == pytest.approx((0.15, 15.0))  # capped


@pytest.mark.slow
def test_engine_cs_tests_are_ordinary_bundles(tmp_path, monkeypatch):
    """Made coarse: two cases, one of images, sealed; the truth opens again and fits its seal."""
    coarse = drawing.Size(2.0, 5.0, ("seb",), 6, 6, 0.2, {"seb": 0.12, "dct": 0.12})
    monkeypatch.setitem(drawing.SIZES, "small", coarse)
    monkeypatch.setattr(making, "SIZES", drawing.SIZES)
    cases = [
        drawing.Case("case-0000", 0, "seb", {"load_gain": 0.1}, "effect", 4.0),
        drawing.Case("case-0001", 0, "seb", {"magnification": 0.001}, "effect", 4.0, images=True, without=("creep",)),
    ]
    monkeypatch.setattr(making, "drawn_cases", lambda *_: cases)
    out = tmp_path / "check"
    assert "2 sealed tests" in making.make(out, seed=4)
    one, two = (read_bundle(out / "bundles" / c.name) for c in cases)
    assert one.fields is not None
    assert np.isfinite(one.fields.displacement[1][one.fields.valid[1]]).all()
    assert len(two.images) == 10
    assert one.curve is not None
    assert two.curve is not None
    gain = one.curve.load.max() / two.curve.load.max()
    assert gain == pytest.approx(1.1, abs=0.01)  # the load cell's gain, and noise of 5 N on some 5 kN
    assert not any("truth" in p.name for p in out.rglob("*"))
    sealed = json.loads((out / SEAL).read_text())
    assert len(sealed["truth_sha256"]) == 64
    assert "salt" not in (out / SEAL).read_text()
    truth = json.loads(unlock(vault_of(out)))
    assert truth["cases"]["case-0001"]["effects"] == {"magnification": 0.001}
    with pytest.raises(InputError, match="sealed already"):
        making.make(out, seed=5)


@pytest.mark.slow
def test_a_small_check_from_end_to_end(tmp_path):
    """The real diagnosis of real sealed tests: a result for each, under unbroken seals."""
    out = tmp_path / "check"
    making.make(out, size="small", seed=11)
    run(out, workers=2)
    open_check(out)
    result = json.loads((out / "result.json").read_text())
    assert result["seals_ok"] is True
    assert result["cases"] == 12
    assert result["failed"] == 0

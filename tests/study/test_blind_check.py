"""Seals, scores and the guarded run of the blind check; engine C's bundles."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers.truth_table import row

from pipeline.core.errors import ConvergenceError, InputError, StoreError
from pipeline.store.bundle import read_bundle
from pipeline.study.blind_check import cases as drawing
from pipeline.study.blind_check import make as making
from pipeline.study.blind_check import specimens as breaking
from pipeline.study.blind_check.guard import Guard
from pipeline.study.blind_check.opening import open_check
from pipeline.study.blind_check.run import replicates, run
from pipeline.study.blind_check.seal import SEAL, VERDICTS, file_digests, lock, salted, unlock, vault_of, write_seal

FAKE = "study.fake_diagnosis:diagnose"


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


def test_a_test_that_cannot_be_followed_is_broken_on_another_mesh(monkeypatch):
    tried = []
    monkeypatch.setattr(breaking, "setup_of", lambda sample, rng: tried.append(rng.integers(2**32)) or len(tried))

    def follow(setup, cmod_max):
        if setup < 3:
            raise ConvergenceError("it snaps back")
        return "path"

    monkeypatch.setattr(breaking, "break_triangles", follow)
    assert breaking.broken_on_some_mesh(None, [1, 7, 0], 1e-3) == (3, "path")
    assert len(set(tried)) == 3  # every mesh is another
    monkeypatch.setattr(breaking, "break_triangles", lambda *_: follow(0, 0))
    with pytest.raises(ConvergenceError, match="snaps back"):
        breaking.broken_on_some_mesh(None, [1, 7, 0], 1e-3)


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


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_a_killed_run_goes_on(sealed):
    hint(sealed, "case-1", sleep=120.0)
    process = started(f"from pipeline.study.blind_check.run import run; run(Path({str(sealed)!r}), diagnose={FAKE!r})")
    wait_until((sealed / "woken").exists)
    process.kill()
    process.wait()
    diagnosis = int((sealed / "woken").read_text())
    wait_until(lambda: ended(diagnosis))  # nobody tells it, and it would sleep for two minutes
    assert not (sealed / VERDICTS).exists()
    assert "3 verdicts sealed" in run(sealed, diagnose=FAKE)
    calls = [line.split()[0] for line in (sealed / "calls.txt").read_text().splitlines()]
    assert calls == ["case-0", "case-1", "case-1", "case-2"]  # what was finished is not repeated


def ended(pid: int) -> bool:
    """Whether a process is gone, or dead and not yet collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def started(program: str) -> subprocess.Popen[bytes]:
    """A process with everything that it starts in one group."""
    root = Path(__file__).resolve().parents[2]
    paths = os.pathsep.join(map(str, [root, root / "tests", *filter(None, [os.environ.get("PYTHONPATH")])]))
    command = [sys.executable, "-c", f"from pathlib import Path; {program}"]
    return subprocess.Popen(command, env=os.environ | {"PYTHONPATH": paths}, start_new_session=True)


def wait_until(there: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not there():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.slow
def test_engine_cs_tests_are_ordinary_bundles(tmp_path, monkeypatch):
    """Made coarse: two cases, one of images, sealed; the truth opens again and fits its seal."""
    coarse = drawing.Size(2.0, 5.0, ("seb",), 6, 6, 0.2, 6, {"seb": 0.12, "dct": 0.12})
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
def test_a_killed_make_goes_on_to_the_same_bundles(tmp_path, monkeypatch):
    """Killed between its specimens, then taken up again: bytes are those of a make that nobody stopped."""
    monkeypatch.setitem(drawing.SIZES, "small", drawing.Size(2.0, 5.0, ("seb",), 6, 6, 0.2, 6, {"seb": 0.12}))
    effects = [{}, {"modulus": 0.3}, {"air_voids": 0.1}, {"load_gain": 0.1}]
    cases = [drawing.Case(f"case-{k}", 0, "seb", e, "effect") for k, e in enumerate(effects)]
    monkeypatch.setattr(making, "drawn_cases", lambda *_: cases)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    making.make(whole, seed=4)
    process = started(
        "from pipeline.study.blind_check import cases, make; "
        f"cases.SIZES['small'] = cases.{drawing.SIZES['small']}; "
        f"of = lambda k, e: cases.Case(f'case-{{k}}', 0, 'seb', e, 'effect'); "
        f"make.drawn_cases = lambda *_: [of(k, e) for k, e in enumerate({effects})]; "
        f"make.make(Path({str(killed)!r}), seed=4)"
    )
    wait_until(lambda: any(killed.glob("bundles/*/experiment.toml")))
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (killed / SEAL).exists()
    assert "4 sealed tests" in making.make(killed, seed=4)
    assert file_digests(killed / "bundles") == file_digests(whole / "bundles")


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

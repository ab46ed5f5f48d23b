"""Diagnoses of the blind check's tests: they say what a hint in the bundle tells them to say or to do."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path


def diagnose(
    bundles: Sequence[Path], out: Path, *, without: Sequence[str] = (), seed: int | None = None,
    workers: int | None = None,
) -> str:  # fmt: skip
    """Name what the hint of each names, write down that it was called, open what the hint asks for."""
    check = Path(out).parents[1]
    with open(check / "calls.txt", "a") as calls:
        calls.write(f"{'+'.join(b.name for b in bundles)} {' '.join(without)}\n")
    for bundle in bundles:
        hint = json.loads((bundle / "hint.json").read_text())
        if "open" in hint:
            Path(hint["open"]).read_bytes()
        if "write" in hint:
            Path(hint["write"]).write_bytes(b"x")
        if "sleep" in hint and not (check / "woken").exists():
            (check / "woken.part").write_text(str(os.getpid()))
            (check / "woken.part").rename(check / "woken")
            time.sleep(hint["sleep"])
        if "wait_for" in hint and not (check / hint["wait_for"]).exists():
            raise RuntimeError("it was stopped")
        result = {"verdict": "cause", "named": [hint["says"]], "probability": {hint["says"]: 0.9, "none": 0.1},
                  "set_90": [hint["says"]], "equivalence_classes": []}  # fmt: skip
        for folder in {Path(out) / bundle.name if len(bundles) > 1 else Path(out), Path(out)}:
            (folder / "result.json").write_text(json.dumps(result))
    return "said"

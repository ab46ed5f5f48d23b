"""Diagnoses of the blind check's tests: they say what a hint in the bundle tells them to say or to do."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path


def diagnose(
    bundles: Sequence[Path], out: Path, *, without: Sequence[str] = (), seed: int | None = None,
    workers: int | None = None,
) -> str:  # fmt: skip
    """Name what the hint names, write down that it was called, open what the hint asks for."""
    hint = json.loads((bundles[0] / "hint.json").read_text())
    with open(Path(out).parents[1] / "calls.txt", "a") as calls:
        calls.write(f"{bundles[0].name} {' '.join(without)}\n")
    if "open" in hint:
        Path(hint["open"]).read_bytes()
    if "write" in hint:
        Path(hint["write"]).write_bytes(b"x")
    if "wait_for" in hint and not (Path(out).parents[1] / hint["wait_for"]).exists():
        raise RuntimeError("it was stopped")
    result = {"verdict": "cause", "named": [hint["says"]], "probability": {hint["says"]: 0.9, "none": 0.1},
              "set_90": [hint["says"]], "equivalence_classes": []}  # fmt: skip
    (Path(out) / "result.json").write_text(json.dumps(result))
    return "said"

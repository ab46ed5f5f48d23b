"""The command cross-check: what it leaves, and that it fails where a check does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.store.layouts import CROSS_CHECK
from pipeline.store.results import read_arrays, read_result
from pipeline.study import cross_check
from pipeline.study.agreement import Check
from pipeline.study.specimens import section_trial


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse particles, two speeds, and nothing but the comparison of LAMMPS with equilibrium."""
    monkeypatch.setattr(cross_check, "section_trial", lambda *_: section_trial("seb", 2.0, 1, 90.0))
    # 10 % and 0.3 %: the ends of the series, whose errors a check compares, and enough for an order
    monkeypatch.setattr(cross_check, "ACCURACIES", (0.1, 0.003))
    monkeypatch.setattr(cross_check, "_specimens", lambda *_: [])
    for part in ("_steps", "_kinematics", "_scaling"):
        monkeypatch.setattr(cross_check, part, lambda *_: [])


def test_a_check_that_fails_is_told_and_everything_is_left(
    small: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = Check("one bond", "load and law", 0.5, 0.1, "made up")
    monkeypatch.setattr(cross_check, "closed_form_checks", lambda: [bad])
    with pytest.raises(ConvergenceError, match=r"1 of 5 checks failed: one bond; see .*report.html"):
        cross_check.cross_check(tmp_path / "out", workers=1)
    result = read_result(tmp_path / "out")
    assert result["passed"] is False
    assert result["checks"][0] | {"passed": False} == result["checks"][0]
    assert [run["engine"] for run in result["runs"]] == ["equilibrium, refined", "lammps", "lammps"]
    arrays = read_arrays(tmp_path / "out", CROSS_CHECK)
    assert np.all(np.diff(arrays["convergence/curve_error"]) < 0), "slower is nearer"
    html = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "one bond: load and law differ by 0.5" in html


@pytest.mark.slow
def test_the_command_passes(tmp_path: Path) -> None:
    assert "checks passed" in cross_check.cross_check(tmp_path)
    checks = read_result(tmp_path)["checks"]
    assert len(checks) > 25
    assert all(check["passed"] for check in checks)

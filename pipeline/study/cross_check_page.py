"""What a cross-check shows: every check with its tolerance, convergence, differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.report.agreement import checks as draw_checks
from pipeline.report.agreement import convergence, load_differences
from pipeline.report.page import Number, Section, page
from pipeline.study.agreement import Check
from pipeline.study.pages import picture, write_page


def cross_check_page(
    folder: Path, checks: Sequence[Check], series: Mapping[str, Any], differences: Mapping[str, np.ndarray]
) -> None:
    """Write figures and report.html."""
    errors = {"load": series["curve_error"], "field": series["field_error"]}
    share = [check.difference / check.tolerance if check.tolerance else float(not check.passed) * 2 for check in checks]
    names = [f"{check.name}: {check.compared.split(',')[0]}" for check in checks]
    rows = {name: values for name, values in differences.items() if name != "cmod"}
    figures = [
        picture(
            folder,
            "convergence",
            partial(convergence, steps=series["steps"], error=errors, order=series["order_curve"]),
            "LAMMPS, ever slower, against equilibrium.",
        ),
        picture(
            folder,
            "differences",
            partial(load_differences, cmod=differences["cmod"], differences=rows),
            "Load of LAMMPS at several accuracies less that of equilibrium.",
        ),
        picture(folder, "checks", partial(draw_checks, names=names, share=share), "Differences over tolerances.", True),
    ]
    sections = [Section("How near", figures=figures)]
    for name, group in groupby(checks, key=lambda check: check.name):
        sections.append(Section(name, numbers=[_number(check) for check in group]))
    failed = [
        f"{check.name}: {check.compared} differ by {check.difference:.2g}" for check in checks if not check.passed
    ]
    footer = [f"cohesive-bpm {__version__}, command cross-check"]
    subtitle = "engines against each other and against closed forms"
    write_page(folder, page("Cross-check", sections, subtitle=subtitle, warnings=failed, footer=footer))


def _number(check: Check) -> Number:
    sign = "≤" if check.passed else ">"
    return Number(check.compared, f"{check.difference:.2g} {sign} {check.tolerance:.2g}", f"tolerance: {check.reason}")

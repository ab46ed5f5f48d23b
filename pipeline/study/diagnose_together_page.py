"""The report of several tests diagnosed together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.gap.score import NONE, names_of
from pipeline.gap.together import Together
from pipeline.gap.transfer import Test
from pipeline.report.diagnosis import closures, forest, loads, ranking
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.study.diagnose_arrays import whole_curve
from pipeline.study.diagnose_case import Case
from pipeline.study.diagnose_page import footer, load_std, unseen_section, where_figures
from pipeline.study.diagnose_words import (
    CALLED,
    alike,
    closure_row,
    likely,
    next_section,
    verdict_section,
    where_told,
)
from pipeline.study.pages import picture, write_page

COLUMNS, WIDTH, HEIGHT = 3, 190.0, 60.0  # panels side by side; mm of all, and of a row


def together_page(folder: Path, cases: Mapping[str, Case], joint: Together, result: Mapping[str, Any]) -> None:
    """Figures and report.html of several tests; each has its own in a folder beside."""
    remarks = ["Log Bayes factors are pooled by their median: no single test decides.", *result["remarks"]]
    sections = [
        verdict_section(result, remarks),
        _each(folder, joint, result),
        Section(
            "Where tests and simulations part",
            text=f"Root mean squares over {len(cases)} tests. {where_told(result['where'])}",
            figures=where_figures(folder, result["where"]),
        ),
        _transfer(folder, cases, joint, result),
        unseen_section(folder, result),
        next_section(result),
    ]
    title = f"{len(cases)} tests together: {', '.join(cases)}"
    text = page(
        title, sections, subtitle="sim-to-real gap", warnings=result["warnings"], footer=footer(result)
    )  # fmt: skip
    write_page(folder, text)


def _each(folder: Path, joint: Together, result: Mapping[str, Any]) -> Section:
    numbers = []
    for name, row in result["bundles"].items():
        named = f" {', '.join(row['named'])}" if row["named"] else ""
        told = (
            f"first: {CALLED.get(row['first'], row['first'])}, probability {row['probability']:.2f}; "
            f"{row['geometry']}, {row['cmod_rate_mm_per_min']:g} mm/min; see {name}/report.html"
        )
        numbers.append(Number(name, f"{row['verdict']}{named}", told))
    each = {t.name: t.diagnosis.scored.probability for t in joint.tests}
    told = "Probability of each explanation: pooled (bars), by every test alone (circles)."
    figures = [picture(folder, "ranking", lambda a: ranking(a, joint.scored.probability, each), told)]
    top = names_of(joint.scored.causes()[0])[0]
    rows, unit = _sizes(joint, top), result["estimate"][top]["unit"]
    label = f"{top}{'' if unit == '1' else f' ({unit})'}"
    told = "Its size in every test, if it is the only one, with 95 % intervals."
    figures.append(picture(folder, "sizes", lambda a: forest(a, rows, label), told))
    pooled = [Number(f"together: {n.name}", n.value, n.remark) for n in likely(result)]
    return Section("The tests one by one, and together", numbers=[*numbers, *pooled], figures=figures,
                   notes=alike(result))  # fmt: skip


def _sizes(joint: Together, name: str) -> dict[str, tuple[float, float, float]]:
    temperature, found = joint.scored.temperature, {}
    for test in joint.tests:
        fitted = test.diagnosis.fits[name]
        low, high = (float(x) for x in fitted.interval(temperature=temperature)[0])
        found[test.name] = float(fitted.values(temperature)[0]), low, high
    return found


def _transfer(folder: Path, cases: Mapping[str, Case], joint: Together, result: Mapping[str, Any]) -> Section:
    figures = [_curves(folder, joint)] if any(t.diagnosis.observation.has_load for t in joint.tests) else []
    rows = {f"{t['explanation']} → {t['target']}": t for t in result["transfer"]}
    if any(t["fraction"] is not None for t in rows.values()):
        told = "Share of the gap of each test that is closed by what was fitted to the others."
        figures.append(picture(folder, "transfer", lambda a: closures(a, rows), told, wide=len(rows) > 6))
    numbers = [closure_row(label, t) for label, t in rows.items()]
    notes = [_carried(t) for t in {(t["explanation"], t["kind"]): t for t in result["transfer"]}.values()]
    notes.append("f_max and delta_max are taken over unchanged: what specimens differ by counts as gap here.")
    if not rows:
        notes.append("No explanation could be taken from test to test.")
    return Section("What the other tests predict", numbers=numbers, figures=figures, notes=notes)


def _carried(row: Mapping[str, Any]) -> str:
    own = f"; {', '.join(row['refitted'])} is each test's own" if row["refitted"] else ""
    where = "replicates" if row["kind"] == "replicate" else "other conditions"
    return f"{row['explanation']}, to {where}: {', '.join(row['carried'])} carried over{own}"


def _curves(folder: Path, joint: Together) -> Figure:
    best = joint.scored.first()
    draw: list[Draw] = [lambda a, t=t: _curve(a, t, best) for t in joint.tests]  # type: ignore[misc]
    columns = min(COLUMNS, len(draw))
    data = png(*draw, columns=columns, width=WIDTH * columns / COLUMNS, height=HEIGHT * -(-len(draw) // columns))
    write_atomically(folder / "curves.png", data)
    told = f"Load: the model as it is, and with the pooled first explanation ({CALLED.get(best, best)})."
    return Figure(data, told, wide=True)


def _curve(axes: Any, test: Test, best: str) -> Any:
    d = test.diagnosis
    labels = dict.fromkeys((NONE, best))
    curves = {CALLED.get(n, "with it"): whole_curve(d, d.fits[n]) for n in labels}
    loads(axes, d.observation, curves, None, load_std(d))
    axes.get_legend().set_loc("upper right")
    axes.set_title(test.name)
    return axes

"""The report of a diagnosis, for a laboratory engineer to act on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.effects import effect
from pipeline.gap.identifiability import DETECTED
from pipeline.gap.observation import STAGES, Reading
from pipeline.gap.score import NONE
from pipeline.report.diagnosis import closures, detectability, differences, loads, ranking, where_map
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.study.assembly import Model
from pipeline.study.diagnose_sight import Seen
from pipeline.study.effects import Band
from pipeline.study.pages import picture, write_page

WIDE = {"width": 180.0, "height": 62.0}  # mm


def diagnosis_page(
    folder: Path, model: Model, look: Seen, diagnosis: Diagnosis, result: Mapping[str, Any], band: Band
) -> None:
    """Figures and report.html of a diagnosis."""
    sections = [
        Section("The verdict", text=_told(result), numbers=_numbers(result), notes=look.remarks),
        _where(folder, result),
        _which(folder, diagnosis, result),
        _how_far(folder, diagnosis, result),
        _unseen(folder, result),
        Section("What to measure next", notes=result["separate_by"]),
    ]
    footer = [f"cohesive-bpm {result['version']}", f"{result['simulations']} simulations", f"{result['seconds']:.0f} s"]
    text = page(model.bundle.name, sections, subtitle="sim-to-real gap", warnings=result["warnings"], footer=footer)
    write_page(folder, text)


def _told(result: Mapping[str, Any]) -> str:
    named = "; ".join(f"{n}: {effect(n).says}" for n in result["named"])
    return f"{result['verdict']}. {named + '. ' if named else ''}{result['reason']}."


def _numbers(result: Mapping[str, Any]) -> list[Number]:
    rows = []
    for name in result["named"]:
        found = result["estimate"][name]
        low, high = found["interval_95"]
        rows.append(
            Number(
                name, f"{found['value']:.3g} {found['unit']}", f"95 %: {low:.3g} to {high:.3g}, if it is the only one"
            )
        )
    before, after = result["parameters_before"], result["parameters_after"]
    rows += [
        Number("f_max", f"{after['f_max_n']:.4g} N", f"{before['f_max_n']:.4g} N without the explanation"),
        Number("delta_max", f"{after['delta_max_m']:.4g} m", f"{before['delta_max_m']:.4g} m without the explanation"),
    ]
    return rows


def _where(folder: Path, result: Mapping[str, Any]) -> Section:
    cells = result["where"]
    top = cells[0] if cells else None
    told = (
        f"Most out of line: {top['channel']}, {top['stage']}, {top['region']}, {top['mode']}: {top['rms']:.3g} "
        f"{top['unit']}, {top['z_gap']:.2g} times what complete models leave, {top['z_noise']:.2g} times noise."
        if top
        else ""
    )
    figures = []
    if any(c["channel"] == "field" for c in cells):
        for against, words in (("z_gap", "noise and engine discrepancy"), ("z_noise", "noise alone")):
            panels = [_panel(cells, stage, against) for stage in STAGES]
            data = png(*panels, columns=3, **WIDE)
            write_atomically(folder / f"where_{against}.png", data)
            figures.append(Figure(data, f"Difference of the model as it is, over what {words} would give.", wide=True))
    return Section("Where", text=told, figures=figures)


def _panel(cells: list[dict[str, Any]], stage: str, against: str) -> Draw:
    return lambda axes: where_map(axes, cells, stage, against)


def _which(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    classes = [" = ".join(c) + ": not told apart by these data" for c in result["equivalence_classes"]]
    alike = [f"{n} does exactly what {' or '.join(e)} would do" for n, e in result["equivalents"].items()
             if n in result["set_90"]]  # fmt: skip
    figure = picture(folder, "ranking", lambda a: ranking(a, d.scored.probability), "Probability of each explanation.")
    return Section("Which effect", figures=[figure], notes=[*classes, *alike])


def _how_far(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    none, best = d.fits[NONE], d.best
    before = d.emulator.reading(none.parameters)
    after: Reading = d.emulator.reading(best.parameters, best.candidate.names, best.amplitudes)
    figures = []
    label = best.candidate.label
    if d.observation.has_load:
        figures.append(picture(folder, "curve", lambda a: loads(a, d.observation, before, after, label), "Load."))
    if d.observation.has_field:
        told = "Displacements: difference at every station."
        figures.append(picture(folder, "difference", lambda a: differences(a, d.observation, before, after), told))
    if any(c["fraction"] is not None for c in result["closure"].values()):
        told = "Share of the gap closed on data that were not used, first explanation and runners-up."
        figures.append(picture(folder, "closure", lambda a: closures(a, result["closure"]), told))
    notes = [_closed(label, c) for label, c in result["closure"].items()]
    notes.append("A wrong effect can close a gap as well as the right one: only transfer to other tests decides.")
    return Section("How far it closes", figures=figures, notes=notes)


def _closed(label: str, c: Mapping[str, Any]) -> str:
    if c["nothing_to_close"]:
        return f"{label}: nothing to close, the model as it is lies within what engines differ by"
    low, high = c["interval_95"]
    return f"{label}: {c['fraction']:.0%} of the gap on held-out data (95 %: {low:.0%} to {high:.0%})"


def _unseen(folder: Path, result: Mapping[str, Any]) -> Section:
    figure = picture(
        folder, "detectability", lambda a: detectability(a, result["detection_limit"], DETECTED), "What could be seen."
    )
    rows = [
        Number(
            n, f"{row['value']:.3g} {row['unit']}" if row["value"] is not None else "not detectable", "detection limit"
        )
        for n, row in result["detection_limit"].items()
    ]
    notes = ["cannot be excluded: " + ", ".join(result["cannot_exclude"])]
    notes += [f"not tested: {n} ({reason})" for n, reason in result["not_tested"].items()]
    return Section("What these data can and cannot show", numbers=rows, figures=[figure], notes=notes)

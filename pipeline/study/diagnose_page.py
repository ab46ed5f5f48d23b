"""The report of a diagnosis, for a laboratory engineer to act on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.effects import effect, library
from pipeline.gap.identifiability import DETECTED
from pipeline.gap.observation import STAGES
from pipeline.gap.score import NONE
from pipeline.report.diagnosis import (
    closures,
    detectability,
    difference_map,
    differences,
    load_difference,
    loads,
    ranking,
    short,
    where_map,
)
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.study.diagnose_arrays import reading_of, shown, whole_curve
from pipeline.study.diagnose_case import Case
from pipeline.study.pages import picture, write_page

WIDE = {"width": 190.0, "height": 66.0}  # mm
CALLED = {NONE: "model as it is"}
MOST = 2.0  # share of a gap that is written in full
CELLS = 4  # of the table of where, in words
SPEAKS = 0.5  # log Bayes factor, either way, from which data say something of an effect


def diagnosis_page(case: Case, diagnosis: Diagnosis, result: Mapping[str, Any]) -> None:
    """Figures and report.html of a diagnosis."""
    folder = case.folder
    sections = [
        verdict_section(result, case.look.remarks),
        _where(folder, diagnosis, result),
        _which(folder, diagnosis, result),
        _how_far(case, diagnosis, result),
        unseen_section(folder, result),
        next_section(result),
    ]
    text = page(
        case.bundle.name, sections, subtitle="sim-to-real gap", warnings=result["warnings"], footer=footer(result)
    )
    write_page(folder, text)


def footer(result: Mapping[str, Any]) -> list[str]:
    return [
        f"cohesive-bpm {result['version']}",
        f"engine {result['engine']}",
        f"{result['simulations']} simulations",
        f"{result['seconds']:.0f} s, of these {result['seconds_simulating']:.0f} s simulating",
    ]


def verdict_section(result: Mapping[str, Any], remarks: Any) -> Section:
    """What is said, how large it is, what it does to the parameters, what to do about it."""
    told = [f"{result['verdict'].capitalize()}: {_meant(result)}.", f"{_sentence(result['reason'])}."]
    first = next((label for label in result["closure"] if set(label.split(" + ")) <= set(result["named"])), None)
    if first is not None:
        held = "tests that it was not fitted to" if "transfer" in result else "data not used for it"
        told.append(f"{_sentence(closed(first, result['closure'][first], held))}.")
    if result["named"] and result["separate_by"]:
        told.append(f"To check: {result['separate_by'][0].partition(': ')[2]}.")
    hidden = result["cannot_exclude"]
    if hidden:
        count = f"{len(hidden)} effect{'s' if len(hidden) > 1 else ''}"
        told.append(f"Whatever is said here, {count} cannot be excluded by these data (listed below).")
    return Section(
        "The verdict", text=" ".join(told), numbers=[*_sizes(result), *_parameters(result)], notes=list(remarks)
    )


def _meant(result: Mapping[str, Any]) -> str:
    """The verdict in words that need no table."""
    said = [f"{effect(n).says} ({n})" for n in result["named"]]
    return {
        "none needed": "test and model part by no more than honest models part from each other",
        "outside the library": "test and model part in a way that no known effect explains",
    }.get(result["verdict"], "; or ".join(said) if result["verdict"] != "cause" else "; and ".join(said))


def _sentence(text: str) -> str:
    """With a capital, unless it begins with the name of an effect."""
    first = text.split(" ", 1)[0].rstrip(":,")
    return text if "_" in first or first in library() else text[0].upper() + text[1:]


def _sizes(result: Mapping[str, Any]) -> list[Number]:
    rows = []
    for name in result["named"]:
        found = result["estimate"][name]
        low, high = (amount(v, found["unit"]) for v in found["interval_95"])
        rows.append(
            Number(name, amount(found["value"], found["unit"]), f"95 %: {low} to {high}, if it is the only one")
        )
    return rows


def amount(value: float | None, unit: str) -> str:
    """A size with its unit."""
    return "–" if value is None else f"{value:.3g}" + ("" if unit == "1" else f" {unit}")


def _parameters(result: Mapping[str, Any]) -> list[Number]:
    before, after, bias = (result[k] for k in ("parameters_before", "parameters_after", "bias_removed"))
    rows = []
    for name, key, unit in (
        ("f_max", "f_max_n", "N"),
        ("delta_max", "delta_max_m", "m"),
        ("f_max delta_max/(2 r t)", "bond_fracture_energy_j_per_m2", "J/m²"),
    ):
        interval = after.get("interval_95", {}).get(key)
        spread = f"95 %: {interval[0]:.4g} to {interval[1]:.4g}; " if interval else ""
        told = f"{spread}{before[key]:.4g} {unit} ({bias[_bare(key)]:+.0%}) where nothing is added to the model"
        rows.append(Number(name, f"{after[key]:.4g} {unit}", told))
    return rows


def _bare(key: str) -> str:
    return key.removesuffix("_n").removesuffix("_m").removesuffix("_j_per_m2")


def closed(label: str, c: Mapping[str, Any], held: str) -> str:
    """How far an explanation closes the gap, in words."""
    called = CALLED.get(label, label)
    if c["nothing_to_close"]:
        return f"{called}: nothing to close, the model as it is lies within what engines differ by"
    low, high = (percent(x) for x in c["interval_95"])
    return f"{called} closes {percent(c['fraction'])} of the gap on {held} (95 %: {low} to {high})"


def percent(share: float) -> str:
    """A share that may be anything where there is little to close: beyond twice the whole its size says nothing."""
    return f"{'<' if share < -MOST else '>' if share > MOST else ''}{np.clip(share, -MOST, MOST):.0%}"


def _where(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    cells = result["where"]
    figures = where_figures(folder, cells)
    if d.observation.has_load:
        before, told = reading_of(d, d.fits[NONE]), "Load of the model as it is: difference at every station."
        figures.append(
            picture(folder, "where_load", lambda a: load_difference(a, d.observation, before, load_std(d)), told)
        )
    if d.observation.has_field:
        figures.insert(0, _arrows(folder, d))
    return Section("Where test and simulation part", text=where_told(cells), figures=figures)


def where_told(cells: list[dict[str, Any]]) -> str:
    """The cells that stand out most, in words."""
    told = []
    for c in cells[:CELLS]:
        place = [c["channel"], c["stage"], *([c["region"], c["mode"]] if c["channel"] == "field" else [])]
        told.append(
            f"{', '.join(place)}: {short(c['rms'])} {'N' if c['channel'] == 'load' else 'µm'}, {short(c['z_gap'])} "
            f"times what complete models leave, {short(c['z_noise'])} times noise"
        )
    return "After the refit of f_max and delta_max, the model as it is leaves most in " + "; ".join(told) + "."


def where_figures(folder: Path, cells: list[dict[str, Any]]) -> list[Figure]:
    """Maps of region × mode by stage, against what engines differ by and against noise."""
    figures: list[Figure] = []
    if not any(c["channel"] == "field" for c in cells):
        return figures
    for against, words in (("z_gap", "noise and engine discrepancy"), ("z_noise", "noise alone")):
        panels = [_panel(cells, stage, against) for stage in STAGES]
        data = png(*panels, columns=3, **WIDE)
        write_atomically(folder / f"where_{against}.png", data)
        told = (
            f"Model as it is: how many times larger the difference is than {words} would give (1 is expected); below "
            "it the difference itself, root mean square in µm (load: N)."
        )
        figures.append(Figure(data, told, wide=True))
    return figures


def _panel(cells: list[dict[str, Any]], stage: str, against: str) -> Draw:
    return lambda axes: where_map(axes, cells, stage, against)


def field_std(d: Diagnosis) -> np.ndarray:
    """Standard deviation (s, p), m, of noise and discrepancy; NaN where nothing is judged."""
    o = d.observation
    whole = np.full(o.mask.size, np.nan)
    whole[o.mask] = d.data.metric.std
    return np.sqrt(np.mean(whole[: o.reading.field.size].reshape(o.reading.field.shape) ** 2, axis=2))


def load_std(d: Diagnosis) -> np.ndarray:
    """The same of the load (s,), N."""
    whole = np.full(d.observation.mask.size, np.nan)
    whole[d.observation.mask] = d.data.metric.std
    return whole[d.observation.reading.field.size :]


def _arrows(folder: Path, d: Diagnosis) -> Figure:
    before, std = reading_of(d, d.fits[NONE]), field_std(d)
    left = np.where(np.isfinite(std)[..., None], d.observation.reading.field - before.field, 0.0)
    longest = max(float(np.nanmax(np.hypot(left[..., 0], left[..., 1]))), 1e-9)
    panels: list[Draw] = [
        lambda axes, k=k: difference_map(axes, d.observation, before, std, k, longest)  # type: ignore[misc]
        for k in range(len(STAGES))
    ]
    data = png(*panels, columns=3, **WIDE)
    write_atomically(folder / "where_points.png", data)
    told = "Measured minus simulated displacement, model as it is; last station of every stage (triangle: notch tip)."
    return Figure(data, told, wide=True)


def _which(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    figure = picture(folder, "ranking", lambda a: ranking(a, d.scored.probability), "Probability of each explanation.")
    return Section("Which effect", numbers=likely(result), figures=[figure], notes=alike(result))


def speaking(result: Mapping[str, Any]) -> list[str]:
    """Explanations of the 90 % set of which the data say something, either way: others keep their prior."""
    return [n for n in result["set_90"] if n == NONE or abs(result["log_bayes"][n]) >= SPEAKS]


def likely(result: Mapping[str, Any]) -> list[Number]:
    """The explanations that hold 90 % of the probability, with their sizes."""
    rows, said = [], speaking(result)
    for label in said:
        names = label.split(" + ") if label != NONE else []
        sizes = [effect(name).says for name in names]
        if len(names) == 1:
            found = result["estimate"][names[0]]
            sizes = [f"{sizes[0]}: {amount(found['value'], found['unit'])}"]
        told = [] if label == NONE else [f"log Bayes factor {result['log_bayes'][label]:.1f}"]
        rows.append(Number(CALLED.get(label, label), f"{result['probability'][label]:.2f}", "; ".join([*sizes, *told])))
    rest = [n for n in result["set_90"] if n not in said]
    if rest:
        share = sum(result["probability"][n] for n in rest)
        rows.append(Number(f"{len(rest)} others", f"{share:.2f}", "of which the data say nothing, for or against"))
    return rows


def alike(result: Mapping[str, Any]) -> list[str]:
    """What these data do not tell apart, or nobody could."""
    classes = [" = ".join(c) + ": not told apart by these data" for c in result["equivalence_classes"]]
    likely_ = {n for label in result["set_90"] for n in label.split(" + ")}
    same = [
        f"{n} does exactly what {' or '.join(e)} would do" for n, e in result["equivalents"].items() if n in likely_
    ]
    return [*classes, *same]


def _how_far(case: Case, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    fitted = shown(d)[:3]
    names = [CALLED.get(f.candidate.label, f"with {f.candidate.label}") for f in fitted]
    figures = []
    if d.observation.has_load:
        curves = {n: whole_curve(d, f) for n, f in zip(names, fitted, strict=True)}
        curve = case.bundle.curve
        record = None if curve is None else (curve.cmod, curve.load)
        figures.append(
            picture(
                case.folder, "curve", lambda a: loads(a, d.observation, curves, record, load_std(d)),
                "Load before and after; the runner-up beside it.",
            )
        )  # fmt: skip
    if d.observation.has_field:
        readings = {n: reading_of(d, f) for n, f in zip(names, fitted, strict=True)}
        told = "Displacements: root mean square difference at every station, before and after."
        figures.append(
            picture(case.folder, "difference", lambda a: differences(a, d.observation, readings, field_std(d)), told)
        )
    if any(c["fraction"] is not None for c in result["closure"].values()):
        told = "Share of the gap closed on data that were not used, first explanation and runners-up."
        figures.append(picture(case.folder, "closure", lambda a: closures(a, result["closure"]), told))
    notes = ["A wrong effect can close a gap as well as the right one: only transfer to other tests decides."]
    numbers = [closure_row(label, c) for label, c in result["closure"].items()]
    return Section("How far the gap closes", numbers=numbers, figures=figures, notes=notes)


def closure_row(label: str, c: Mapping[str, Any]) -> Number:
    """Closure of one explanation on held-out data, channel by channel, in µm and N."""
    value = "nothing to close" if c["nothing_to_close"] else percent(c["fraction"])
    parts = []
    for channel, key, unit in (("field", "displacement_um", "µm"), ("load", "load_n", "N")):
        before, after = c["before"][key], c["after"][key]
        if before is None:
            continue
        share = c.get("channels", {}).get(channel)
        closed_ = "" if share is None else (" (nothing to close)" if share["fraction"] is None else
                                            f" ({percent(share['fraction'])})")  # fmt: skip
        parts.append(f"{channel} {before:.3g} → {after:.3g} {unit}{closed_}")
    interval = "" if c["nothing_to_close"] else "95 %: {} to {}; ".format(*map(percent, c["interval_95"]))
    return Number(label, value, interval + "; ".join(parts))


def unseen_section(folder: Path, result: Mapping[str, Any]) -> Section:
    """Detection limits, and what stays possible whatever was found."""
    limits = result["detection_limit"]
    figure = picture(folder, "detectability", lambda a: detectability(a, limits, DETECTED), "What could be seen.")
    rows = []
    for name, row in sorted(limits.items(), key=lambda item: -item[1]["d_prime_at_most"]):
        size = effect(name).magnitude
        plausible = f"plausible: {size.low:g} to {amount(size.high, size.unit)}"
        value = "not seen" if row["value"] is None else f"from {amount(row['value'], row['unit'])}"
        rows.append(Number(name, value, f"{effect(name).says}; {plausible}"))
    hidden = ", ".join(result["cannot_exclude"])
    notes = [f"cannot be excluded: {hidden}" if hidden else "every effect of the library would have been seen"]
    notes += [f"not tested: {n} ({reason})" for n, reason in result["not_tested"].items()]
    return Section("What these data can and cannot show", numbers=rows, figures=[figure], notes=notes)


def next_section(result: Mapping[str, Any]) -> Section:
    """What to measure: first what tells the likely explanations apart, then what cannot be seen."""
    likely_ = {n for label in speaking(result) for n in label.split(" + ")} | set(result["named"])
    first = [s for s in result["separate_by"] if s.split(":")[0] in likely_]
    rest = [s for s in result["separate_by"] if s not in first]
    told = "" if not first else "To confirm or to tell apart: " + "; ".join(first) + "."
    return Section("What to measure next", text=told, notes=[f"to see what these data hide – {s}" for s in rest])

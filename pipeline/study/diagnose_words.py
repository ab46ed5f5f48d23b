"""What the report of a diagnosis says in words and tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.gap.effects import effect, library
from pipeline.gap.score import NONE, UNLISTED, names_of
from pipeline.report.diagnosis import short
from pipeline.report.page import Number, Section

CALLED = {NONE: "model as it is", UNLISTED: "an effect that the library lacks"}
MOST = 2.0  # share of a gap that is written in full
CELLS = 4  # of the table of where, in words
SPEAKS = 0.5  # log Bayes factor, either way, from which data say something of an effect


def verdict_section(result: Mapping[str, Any], remarks: Any) -> Section:
    """What is said, how large it is, what it does to the parameters, what to do about it."""
    told = [f"{result['verdict'].capitalize()}: {_meant(result)}.", f"{_sentence(result['reason'])}."]
    first = next((label for label in result["closure"] if set(names_of(label)) <= set(result["named"])), None)
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


def speaking(result: Mapping[str, Any]) -> list[str]:
    """Explanations of the 90 % set of which the data say something, either way: others keep their prior."""
    return [n for n in result["set_90"] if n == NONE or abs(result["log_bayes"][n]) >= SPEAKS]


def likely(result: Mapping[str, Any]) -> list[Number]:
    """The explanations that hold 90 % of the probability, with their sizes."""
    rows, said = [], speaking(result)
    for label in said:
        names = names_of(label)
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
    likely_ = {n for label in result["set_90"] for n in names_of(label)}
    same = [
        f"{n} does exactly what {' or '.join(e)} would do" for n, e in result["equivalents"].items() if n in likely_
    ]
    return [*classes, *same]


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


def next_section(result: Mapping[str, Any]) -> Section:
    """What to measure: first what tells the likely explanations apart, then what cannot be seen."""
    likely_ = {n for label in speaking(result) for n in names_of(label)} | set(result["named"])
    first = [s for s in result["separate_by"] if s.split(":")[0] in likely_]
    rest = [s for s in result["separate_by"] if s not in first]
    told = "" if not first else "To confirm or to tell apart: " + "; ".join(first) + "."
    return Section("What to measure next", text=told, notes=[f"to see what these data hide – {s}" for s in rest])

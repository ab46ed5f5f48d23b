"""Open the truth once, check every seal, score the verdicts, and write it all down, misses first."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.reliability import reliability
from pipeline.store.atomic import write_atomically
from pipeline.store.results import write_result
from pipeline.study.blind_check.goals import GOALS, TOGETHER, Goal, goals_result, verdict_of
from pipeline.study.blind_check.score import scores, scores_together, times
from pipeline.study.blind_check.seal import (
    LOCKED,
    OPENED,
    SEAL,
    VERDICT_SEAL,
    VERDICTS,
    broken_seals,
    canonical,
    digest,
    read_json,
    unlock,
    vault_of,
)
from pipeline.study.pages import picture, write_page

SIZES_TOLD = "In detection limits of each diagnosis's own card, not those by which the tests were made."
ROW = ("specimen", "kind", "effects")  # what every row of a truth table must say


def open_check(out: Path, *, truth: Path | None = None) -> str:
    """Check the seals, score the verdicts, write result.json and report.html.

    Parameters
    ----------
    out : folder that was run
    truth : truth table in the open, of another program; without it that of the vault

    Raises
    ------
    StoreError
        where a bundle, a verdict or the truth is not what was sealed; nothing is scored then
    """
    out = Path(out).resolve()
    vault = vault_of(out) if truth is None else None
    for name in (SEAL, VERDICT_SEAL, VERDICTS):
        if not (out / name).exists():
            raise MissingFileError(f"{out / name} does not exist: run blind-check make and run first")
    content = sealed_truth(vault, truth)
    broken = broken_seals(out, vault, content)
    if broken:
        raise StoreError("the check was tampered with, nothing is scored:\n" + "\n".join(broken))
    table = checked_truth(content)
    seal = read_json(out / VERDICT_SEAL)
    first = not (out / OPENED).exists()
    if first:
        opened = {"verdicts_sha256": seal["verdicts_sha256"], "truth_sha256": digest(content), "salt": table["salt"]}
        write_atomically(out / OPENED, canonical(opened))
    elif read_json(out / OPENED)["verdicts_sha256"] != seal["verdicts_sha256"]:
        raise StoreError("the verdicts are not those of the first opening: they were made when the truth was known")
    verdicts = read_json(out / VERDICTS)
    result = {
        "version": __version__,
        "command": "blind-check open",
        "seals_ok": True,
        "first_opening": first,
        "judged_by": {k: seal[k] for k in ("version", "code_sha256", "sealed") if k in seal},
        "truth_sha256": digest(content),
        "salt": table["salt"],
        "seed": table.get("seed"),
        **scores(table["cases"], verdicts["verdicts"]),
        "together": scores_together(table["cases"], verdicts.get("together", {})),
        "run_times": times(verdicts.get("seconds", {})),
    }
    result["goals"] = goals_result(result)
    write_result(out, result)
    write_page(out, report(result, table["cases"], verdicts["failed"], figures(out, result)))
    return sentence(result)


def sealed_truth(vault: Path | None, file: Path | None) -> bytes:
    """The truth table's bytes, of a vault or a file."""
    if file is not None:
        try:
            return Path(file).read_bytes()
        except OSError as error:
            raise MissingFileError(f"{file} cannot be read: give the truth table that was sealed") from error
    assert vault is not None
    if not (vault / LOCKED).exists():
        raise MissingFileError(f"{vault} holds no truth: make the check first, or give --truth FILE")
    return unlock(vault)


def checked_truth(content: bytes) -> dict[str, Any]:
    """The truth table; refuses one that does not follow the format of docs/blind-check.md."""
    try:
        table = json.loads(content)
        rows = table["cases"]
        missing = [f"{name}: {key}" for name, row in rows.items() for key in ROW if key not in row]
        salt = str(table["salt"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"the truth table does not follow the format ({error}): see docs/blind-check.md") from error
    if missing or len(salt) < 16:
        raise InputError(
            "the truth table does not follow the format of docs/blind-check.md: "
            + (f"missing {', '.join(missing)}" if missing else "its salt is shorter than 16 characters")
        )
    table["cases"] = {name: {"multiple": 0.0, **row} for name, row in rows.items()}
    return dict(table)


def _shown(score: Mapping[str, Any]) -> str:
    value = score["value"]
    return "none" if value is None else f"{value:.2f}"


def _between(score: Mapping[str, Any]) -> str:
    between = score.get("interval_95")
    return "" if between is None or score["value"] is None else f"{between[0]:.2f} to {between[1]:.2f}"


def figures(out: Path, result: Mapping[str, Any]) -> list[Figure]:
    """What the page shows of the stated probabilities."""
    if not result["reliability"]:
        return []
    caption = "Probability of what was named against how often it was right; bars: 95 % after Wilson, figures: cases."
    return [picture(out, "reliability", lambda axes: reliability(axes, result["reliability"]), caption)]


def _took(taken: Mapping[str, Any]) -> list[Number]:
    """Rows of the run times: in total, and the longest."""
    rows = sorted(taken["cases"].items(), key=lambda item: -item[1]["processor_seconds"])
    told = [("all diagnoses", taken["total"]), *rows[:3]] if rows else []
    return [
        Number(n, f"{r['processor_seconds']:.0f} s", f"of processors; {r['seconds']:.0f} s passed") for n, r in told
    ]


def _scored(goal: Goal, result: Mapping[str, Any]) -> Number:
    score = goal.score(result)
    about = [_between(score), f"{score['cases']} cases", verdict_of(goal, result)]
    return Number(goal.says, _shown(score), "; ".join(filter(None, about)))


def report(
    result: Mapping[str, Any], truth: Mapping[str, Any], failed: Mapping[str, str], pictures: Sequence[Figure] = ()
) -> str:
    """The page: misses, scores beside goals and baselines, confusion, reliability."""
    misses = [
        Number(f"{m['case']}: {m['truth']}", f"{m['said']} ({m['probability']:.2f})", f"{m['verdict']}; {m['effects']}")
        for m in result["misses"]
    ]
    rows = [_scored(goal, result) for goal in GOALS if not goal.key.startswith(TOGETHER)]
    pooled = [_scored(goal, result) for goal in GOALS if goal.key.startswith(TOGETHER)]
    simple = [
        Number(name.replace("_", " "), _shown(row["top1"]), f"{_between(row['top1'])}; {row['top1']['cases']} cases")
        for name, row in result["baselines"].items()
    ]
    confused = [
        Number(t, ", ".join(f"{said} {count}" for said, count in row.items())) for t, row in result["confusion"].items()
    ]
    bins = [
        Number(f"stated {b['stated']:.2f}", f"achieved {b['achieved']:.2f}", f"{b['cases']:.0f} cases")
        for b in result["reliability"]
    ]
    by_multiple = [
        Number(n, ", ".join(f"{m} × limit: {v['right']:.2f} of {v['cases']}" for m, v in r.items()))
        for n, r in result["detection_limits"].items()
    ]
    sections = [
        Section("Misses", text=f"{len(misses)} of {result['cases']} cases were not named right.", numbers=misses),
        Section("Scores", text="95 % intervals after Wilson, for cases clustered by specimen.", numbers=rows),
        Section("Replicates together", text=f"{result['together']['sets']} sets.", numbers=pooled),
        Section("Simpler ways to choose: exact top-1", numbers=simple),
        Section("Confusion: truth and what was most probable", numbers=confused),
        Section("Reliability of the stated probability", numbers=bins, figures=list(pictures)),
        Section("Named right by size of the effect", text=SIZES_TOLD, numbers=by_multiple),
        Section("Time taken", numbers=_took(result["run_times"])),
        Section("Diagnoses that failed", notes=[f"{name}: {why}" for name, why in sorted(failed.items())]),
    ]
    judge = result["judged_by"]
    footer = [f"judged by version {judge['version']}, code {judge['code_sha256'][:12]}", f"sealed {judge['sealed']}"]
    warnings = [] if result["first_opening"] else ["This check was opened before; the verdicts are those of then."]
    return page("Blind check", sections, subtitle=f"{len(truth)} sealed tests", warnings=warnings, footer=footer)


def sentence(result: Mapping[str, Any]) -> str:
    """The check in one line, then its scores beside their goals."""
    parts = [f"{told} {_shown(result[key])}" for key, told in (("top1", "top-1"), ("class_top1", "by class"))]
    parts += [
        f"false alarms {_shown(result['false_alarm'])}",
        f"random {_shown(result['baselines']['random']['top1'])}",
    ]
    met = [row["met"] for row in result["goals"].values() if row["met"] is not None]
    told = f"seals hold; {result['cases']} cases, {result['failed']} failed: {', '.join(parts)}"
    lines = [f"{goal.says}: {_shown(goal.score(result))}, {verdict_of(goal, result)}" for goal in GOALS]
    return "\n".join([told, f"{sum(met)} of {len(met)} goals met", *lines])

"""Detection limits by which a check scales its effects: of effect-free tests of engine B, never of engine C."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import InputError, PipelineError
from pipeline.execution.here import Here
from pipeline.execution.progress import Silent
from pipeline.gap.diagnosis import diagnose
from pipeline.gap.effects import effect, library
from pipeline.gap.identifiability import DETECTED, Card
from pipeline.gap.library import FILE as LIBRARY
from pipeline.gap.library import shipped
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.results import plain
from pipeline.store.start import start_parameters
from pipeline.study.batch import Batch
from pipeline.study.diagnose_case import ENGINE, prepared

FILE, FORMAT = "limits.json", 1
FIRST_SEED = 9400  # of the specimens: neither the library's nor of its trials

log = logging.getLogger("pipeline.study")


@dataclass(frozen=True)
class Limits:
    """Detection limit of every effect, and whose it is.

    Parameters
    ----------
    value : effect → its limit; beyond the plausible maximum where no plausible size is detected, inf without any trace
    source : what `seal.json` says of them
    """

    value: Mapping[str, float]
    source: Mapping[str, Any]

    def told(self) -> dict[str, Any]:
        """Source and limits for JSON; None: inf."""
        return {**self.source, "limits": {n: finite_or_none(v) for n, v in sorted(self.value.items())}}


def finite_or_none(value: float) -> float | None:
    """A number that JSON knows."""
    return float(value) if np.isfinite(value) else None


def limits_of(file: Path | None, geometry: str, radius_mm: float) -> Limits:
    """Detection limits of the result.json of a diagnosis; without it those that ship for geometry and radius.

    Raises
    ------
    InputError
        where the file holds none, or none ship for the geometry
    """
    if file is None:
        return shipped_limits(geometry, radius_mm)
    try:
        content = Path(file).read_bytes()
        given = json.loads(content)["detection_limit"]
        rows = {n: reached(n, row["value"], row.get("d_prime_at_most") or 0.0) for n, row in given.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file} holds no detection limits ({error}): give the result.json of a diagnosis") from error
    source = {"of": "a diagnosis", "file_sha256": hashlib.sha256(content).hexdigest()}
    return Limits(_whole(rows), source)


def shipped_limits(geometry: str, radius_mm: float) -> Limits:
    """The medians over effect-free tests of engine B that ship, of the radius nearest in proportion."""
    raw = json.loads(resources.files("pipeline.study.blind_check").joinpath(FILE).read_text("utf-8"))
    if raw.get("format") != FORMAT:
        raise InputError(f"{FILE} is not of format {FORMAT}: make it anew with scripts/blind_limits.py")
    own = [e for e in raw["entries"] if e["geometry"] == geometry]
    if not own:
        raise InputError(f"{FILE} holds no detection limits of {geometry}: make them with scripts/blind_limits.py")
    entry = min(own, key=lambda e: abs(np.log(radius_mm / e["radius_mm"])))
    rows = {n: reached(n, row["limit"], row["d_prime_at_most"]) for n, row in entry["effects"].items()}
    source = {"of": "effect-free tests of engine B", **{k: v for k, v in entry.items() if k != "effects"}}
    source["by_library_in_use"] = entry["library_sha256"] == library_digest()
    return Limits(_whole(rows), source)


def library_digest() -> str:
    """SHA-256 of the library of discrepancies that ships."""
    return hashlib.sha256(resources.files("pipeline.gap").joinpath(LIBRARY).read_bytes()).hexdigest()


def reached(name: str, limit: float | None, d_prime: float) -> float:
    """The detection limit; in proportion to d′ beyond the plausible maximum, inf where the effect leaves no trace."""
    if limit is not None:
        return float(limit)
    return float(effect(name).magnitude.high * DETECTED / d_prime) if d_prime > 0 else float("inf")


def _whole(rows: Mapping[str, float]) -> dict[str, float]:
    return {n: float(rows.get(n, np.inf)) for n in library()}


def make_limits(batch: Batch, file: Path, seeds: Sequence[int]) -> str:
    """Diagnose effect-free virtual tests, write the medians of their cards; goes on where it stopped.

    Parameters
    ----------
    file : written; an entry of the same geometry and radius is replaced, others stay
    seeds : of the specimens
    """
    cards, batch = [], batch.with_creep()  # as in the sealed bundles
    for seed in seeds:
        batch.progress.stage(f"effect-free test of seed {seed}")
        try:
            cards.append(card_of(batch, seed))
        except PipelineError as error:
            log.warning("seed %d is left out: %s", seed, error)
    if not cards:
        raise InputError("no effect-free test could be diagnosed: there are no limits to be written")
    rows = medians(cards)
    entry = {
        "geometry": batch.geometry,
        "radius_mm": batch.radius_mm,
        "seeds": [seeds[0], seeds[-1]],
        "tests": len(cards),
        "version": __version__,
        "temperature": batch.entry(shipped()).temperature,
        "library_sha256": library_digest(),
        "effects": rows,
    }
    write_entry(file, entry)
    seen = sum(row["limit"] is not None for row in rows.values())
    return f"{len(cards)} effect-free tests; {seen} of {len(library())} effects have a detection limit"


def card_of(batch: Batch, seed: int) -> Card:
    """The card of one effect-free virtual test by the library that ships."""
    folder = batch.folder(seed)
    bundle = folder / "test"
    batch.make(bundle, seed)
    settings = RunSettings(workers=1)
    case = prepared(read_bundle(bundle), folder / "diagnosis", ENGINE, settings, Silent(), Here())
    rng = np.random.default_rng(seed)
    start = start_parameters(case.bundle)
    look, entry = case.look, batch.entry(shipped())
    return diagnose(look.observation, look.abscissae, case.simulator, start, entry, rng, closed=0).card


def medians(cards: Sequence[Card]) -> dict[str, dict[str, float | None]]:
    """Limit (None: beyond the plausible maximum) and d′ at the maximum, medians over the tests that could judge it."""
    found: dict[str, dict[str, float | None]] = {}
    for name in library():
        own = [c for c in cards if name in c.names]
        rows = [(c.limit[c.names.index(name)], c.d_prime[c.names.index(name)]) for c in own]
        if not rows:
            continue
        limit, d_prime = (float(np.median(column)) for column in zip(*rows, strict=True))
        found[name] = {
            "limit": float(f"{limit:.4g}") if np.isfinite(limit) else None,
            "d_prime_at_most": float(f"{d_prime:.4g}"),
        }
    return found


def write_entry(file: Path, entry: Mapping[str, Any]) -> None:
    """Put an entry into the file, in the place of that of its geometry and radius."""
    old: Iterable[Mapping[str, Any]] = json.loads(file.read_text("utf-8"))["entries"] if file.exists() else ()
    others = [e for e in old if (e["geometry"], e["radius_mm"]) != (entry["geometry"], entry["radius_mm"])]
    entries = sorted([*others, entry], key=lambda e: (e["geometry"], e["radius_mm"]))
    write_atomically(file, (json.dumps(plain({"format": FORMAT, "entries": entries}), indent=1) + "\n").encode())

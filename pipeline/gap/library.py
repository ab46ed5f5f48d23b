"""What is known of honest engines' differences, and how far probabilities may be trusted; learnt offline, shipped."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.units import MM, UM
from pipeline.gap.discrepancy import ALL, Discrepancy
from pipeline.gap.effects import effect, library
from pipeline.gap.modes import LOAD
from pipeline.gap.observation import Observation

FILE, FORMAT = "library.json", 3
HOLDS = (0.75, 1.5)  # of the radius that it was learnt at: where an entry holds
ENOUGH = 20  # tests behind a temperature
SIZES = np.where([mode == LOAD for mode in ALL], 1e-2, UM)  # units of amplitudes in the file: µm, per cent of the load


@dataclass(frozen=True)
class Domain:
    """For what a discrepancy was learnt.

    Parameters
    ----------
    geometry : str
    radius : (low, high), m; of the diagnosing particles
    cmod : float, m; last station
    noise : (low, high), m; of one displacement component
    """

    geometry: str
    radius: tuple[float, float]
    cmod: float
    noise: tuple[float, float]

    @property
    def learnt_at(self) -> float:
        """The radius of the diagnosing particles, m."""
        return self.radius[0] / HOLDS[0]


@dataclass(frozen=True, eq=False)
class Entry:
    """A discrepancy with its domain, its check and the temper of the probabilities.

    Parameters
    ----------
    domain : Domain
    discrepancy : Discrepancy
    temperature : float, at least 1
    tests : int; blind tests behind the temperature, 0: not calibrated
    check : mode → χ² over degrees of freedom of left-out specimens, at each one's own scale
    freedom : float; second degrees of freedom of F that left-out specimens follow, for the gate
    parameters : "f_max", "delta_max" → mean and standard deviation of log(identified/true) of the specimens
    seeds : (first, last) of the specimens
    apparent : physics effect → standard deviation of the value that specimens without effects seem to have
    """

    domain: Domain
    discrepancy: Discrepancy
    temperature: float
    tests: int
    check: Mapping[str, float]
    freedom: float = 20.0
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    seeds: tuple[int, int] = (0, 0)
    apparent: Mapping[str, float] = field(default_factory=dict)

    def warnings(self, geometry: str, radius: float, observation: Observation) -> list[str]:
        """What of a test lies outside the domain; one sentence each."""
        d, found = self.domain, []
        if geometry != d.geometry:
            found.append(f"the library of discrepancies was learnt on {d.geometry}, not on {geometry}")
        if not d.radius[0] * 0.999 <= radius <= d.radius[1] * 1.001:
            found.append(
                f"particles of {radius / MM:.3g} mm: the library holds for {d.radius[0] / MM:.3g} to "
                f"{d.radius[1] / MM:.3g} mm"
            )
        last = observation.sight.cmod.max()
        if last > 1.05 * d.cmod:
            found.append(f"stations up to {last / MM:.3g} mm: the library holds up to {d.cmod / MM:.3g} mm")
        if observation.has_field:
            typical = float(np.nanmedian(observation.field_std))
            if not d.noise[0] <= typical <= d.noise[1]:
                found.append(
                    f"noise of {typical / UM:.3g} µm: the library holds for {d.noise[0] / UM:.3g} to "
                    f"{d.noise[1] / UM:.3g} µm"
                )
        if self.parameters:
            (strength, s_std), (opening, o_std) = (self.parameters[n] for n in ("f_max", "delta_max"))
            found.append(
                "tests of another engine that lack nothing are identified with f_max "
                f"{np.expm1(strength):+.0%} ± {s_std:.0%} and delta_max {np.expm1(opening):+.0%} ± {o_std:.0%} off the "
                "truth: the parameters are known no better"
            )
        known = f"on {self.tests} virtual tests of one other engine" if self.tests else "on no tests yet"
        few = " only" if 0 < self.tests < ENOUGH else ""
        found.append(f"probabilities are calibrated {known}{few}: for a real specimen take them as too sure")
        return found


def shipped() -> list[Entry]:
    """The entries of the library that comes with the package."""
    text = resources.files("pipeline.gap").joinpath(FILE).read_text("utf-8")
    return parse(json.loads(text))


def nearest(entries: list[Entry], geometry: str, radius: float) -> Entry:
    """The entry to judge a test by: of its geometry where there is one, of the radius nearest in proportion.

    What is due to the size of particles is in proportion to the radius (m) of the test at hand.

    Raises
    ------
    InputError
        where the library is empty
    """
    if not entries:
        raise InputError("the library of discrepancies is empty: make it with scripts/gap_library")
    own = [e for e in entries if e.domain.geometry == geometry] or entries
    entry = min(own, key=lambda e: abs(np.log(radius / np.sqrt(e.domain.radius[0] * e.domain.radius[1]))))
    finer = radius / entry.domain.learnt_at
    scaled = {n: v * (finer if n in library() and effect(n).coarseness else 1.0) for n, v in entry.apparent.items()}
    return replace(entry, apparent=scaled)


def parse(raw: Mapping[str, Any]) -> list[Entry]:
    """Entries from what the file holds.

    Raises
    ------
    InputError
        for another format, or other modes
    """
    if raw.get("format") != FORMAT or raw.get("modes") != list(ALL):
        raise InputError(f"{FILE} is not of format {FORMAT} with the modes {', '.join(ALL)}: make it anew")
    return [_entry(e) for e in raw["entries"]]


def _entry(raw: Mapping[str, Any]) -> Entry:
    d = raw["domain"]
    domain = Domain(
        d["geometry"],
        (d["radius_mm"][0] * MM, d["radius_mm"][1] * MM),
        d["cmod_mm"] * MM,
        (d["noise_um"][0] * UM, d["noise_um"][1] * UM),
    )
    discrepancy = Discrepancy(
        np.array(raw["amplitude_um"]) * SIZES[:, None],
        np.array(raw["correlation"]),
        np.array(raw["remainder_um"]) * UM,
        raw["length_mm"] * MM,
        raw["spread_mm"] * MM,
        raw["samples"],
        np.array(raw["white_um"]) * UM,
        np.array(raw["waves_um"]) * SIZES[:, None],
        raw["empirical"],
        raw["tail"] or np.inf,
        raw["placements"],
    )
    return Entry(
        domain,
        discrepancy,
        raw["temperature"],
        raw["tests"],
        raw["check"],
        raw["freedom"],
        {name: (one, two) for name, (one, two) in raw["parameters"].items()},
        (raw["seeds"][0], raw["seeds"][1]),
        raw["apparent"],
    )


def written(entries: list[Entry], told: Mapping[str, Any]) -> str:
    """The text of the file; `told` says how it was made."""
    raw = {"format": FORMAT, "modes": list(ALL), "made": dict(told), "entries": [_raw(e) for e in entries]}
    return (
        re.sub(r"\n\s+(?=-?[\d.])|(?<=[\d.])\n\s+(?=\])", " ", json.dumps(raw, indent=1)) + "\n"
    )  # one line a row of numbers


def _raw(entry: Entry) -> dict[str, Any]:
    d, x = entry.domain, entry.discrepancy
    return {
        "domain": {
            "geometry": d.geometry,
            "radius_mm": [r / MM for r in d.radius],
            "cmod_mm": d.cmod / MM,
            "noise_um": [s / UM for s in d.noise],
        },
        "amplitude_um": np.round(x.amplitude / SIZES[:, None], 4).tolist(),
        "correlation": np.round(x.correlation, 4).tolist(),
        "remainder_um": np.round(x.remainder / UM, 4).tolist(),
        "white_um": np.round(x.white / UM, 4).tolist(),
        "length_mm": round(x.length / MM, 4),
        "spread_mm": x.spread / MM,
        "samples": x.samples,
        "seeds": list(entry.seeds),
        "empirical": x.empirical,
        "tail": x.tail if np.isfinite(x.tail) else None,
        "placements": round(x.placements, 4),
        "freedom": round(entry.freedom, 3),
        "parameters": {name: [round(v, 4) for v in both] for name, both in entry.parameters.items()},
        "apparent": {name: float(f"{value:.3g}") for name, value in entry.apparent.items()},
        "temperature": round(entry.temperature, 4),
        "tests": entry.tests,
        "check": {mode: round(value, 3) for mode, value in entry.check.items()},
        "waves_um": np.round(x.waves / SIZES[:, None], 2).tolist(),
    }

"""How well creep, master curves and work of fracture agree with literature, laboratory and known truth."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from pipeline.core.work_of_fracture import area
from pipeline.materials.burgers import Burgers
from pipeline.materials.burgers_fit import NAMES, fit_burgers
from pipeline.materials.interconversion import compliance_of, relaxation_of
from pipeline.materials.master_curve import dynamic_master_curve
from pipeline.materials.prony import PronySeries
from pipeline.materials.series_fit import fit_creep, fit_dynamic, spaced_times
from pipeline.materials.shift_laws import fit_arrhenius, fit_wlf

SETS = ("Park1999", "Gibson2003", "Souza2005")
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)  # asphalt mastic near -12 °C, of the paper's order
READINGS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000.0])  # s, AASHTO T 322
KELVIN = 273.15
Row = tuple[str, ...]


def interconversions(folder: Path) -> Iterator[Row]:
    """Published Prony sets: there and back, s²ẼD̃, and what fits with terms of their own lose."""
    yield "set", "terms", "there and back", "s²ẼD̃ − 1", "fit of D", "E from it"
    for name in SETS:
        time, modulus = np.loadtxt(folder / f"{name}.csv", delimiter=",").T
        series = PronySeries(1e-3 * float(modulus.max()), modulus, time)
        chain = compliance_of(series)
        back = relaxation_of(chain)
        trip = max(np.abs(back.modulus / series.modulus - 1).max(), np.abs(back.time / series.time - 1).max())
        s = np.geomspace(0.01 / series.time[-1], 100 / series.time[0], 200)
        product = np.abs(s**2 * series.laplace(s) * chain.laplace(s) - 1).max()
        at = np.geomspace(series.time[3], series.time[-3], 200)
        fit = fit_creep(at, chain.creep_compliance(at), spaced_times(at[0], at[-1]))
        inside = at[(at > 10 * at[0]) & (at < 0.1 * at[-1])]
        lost = np.abs(np.log(fit.creep_compliance(inside) / chain.creep_compliance(inside))).max()
        moduli = relaxation_of(fit).relaxation_modulus(inside) / series.relaxation_modulus(inside)
        magnified = np.abs(np.log(moduli)).max()
        yield name, f"{time.size}", f"{trip:.0e}", f"{product:.0e}", f"{lost:.2%}", f"{magnified:.2%}"


def coverages(trials: int) -> Iterator[Row]:
    """How often the interval of each Burgers constant holds the truth."""
    yield "record", "noise", *NAMES
    dense = np.geomspace(1, 1000, 60)
    cases: tuple[tuple[str, str, np.ndarray, Callable[[np.random.Generator, int], np.ndarray]], ...] = (
        ("10 readings", "white, 2 %", READINGS, _white),
        ("60 readings", "white, 2 %", dense, _white),
        ("60 readings", "correlated over 5 readings, 2 %", dense, _correlated),
    )
    for title, kind, time, noise in cases:
        random = np.random.default_rng(1)
        held = np.zeros(4)
        for _ in range(trials):
            found = fit_burgers(time, MASTIC.creep_compliance(time) * np.exp(0.02 * noise(random, time.size)))
            held += [_holds(found.interval[name], getattr(MASTIC, name)) for name in NAMES]
        yield title, kind, *(f"{share:.0%}" for share in held / trials)


def binder(folder: Path) -> Iterator[Row]:
    """Shifts, laws and series of a frequency sweep of recovered binder."""
    path = folder / "binder_frequency_sweep_lane1_recovered_rep1.csv"
    rows = np.genfromtxt(path, delimiter=",", names=True)
    modulus = rows["Gp_Pa"] + 1j * rows["Gpp_Pa"]
    master = dynamic_master_curve(rows["omega_rad_s"], modulus, rows["T_C"] + KELVIN, 46 + KELVIN)
    yield "temperature", "log₁₀ a_T", "95 %"
    for level, shift, (low, high) in zip(master.temperature - KELVIN, master.log_shift, master.interval, strict=True):
        yield f"{level:.0f} °C", f"{shift:.3f}", f"± {(high - low) / 2:.3f}"
    terms = spaced_times(0.1 / master.abscissa.max(), 10 / master.abscissa.min())
    series = fit_dynamic(master.abscissa, modulus, terms)
    off = np.sqrt(np.mean(np.abs(series.complex_modulus(master.abscissa) / modulus - 1) ** 2))
    yield "master curve, rms", f"{master.rms:.2%}", f"series of {series.time.size} terms {off:.2%}"
    wlf, arrhenius = fit_wlf(master), fit_arrhenius(master)
    for name, law in (("WLF", wlf), ("Arrhenius", arrhenius)):
        constants = ", ".join(f"{key} {low:.4g} to {high:.4g}" for key, (low, high) in law.interval.items())
        yield name, f"rms {law.rms:.3f}", constants


def dent(folder: Path) -> Iterator[Row]:
    """Areas of the laboratory's DENT curves against the energies it reports."""
    curves = defaultdict(list)
    for row in _rows(folder / "dent_curves_lig5mm.csv"):
        curves[row["binder"], row["lane"]].append((float(row["displacement_mm"]) * 1e-3, float(row["force_N"])))
    yield "binder", "lane", "area (J)", "reported (J)", "difference"
    for row in _rows(folder / "dent_check.csv"):
        ours, theirs = area(*np.array(curves[row["binder"], row["lane"]]).T), float(row["E_reported_J"])
        yield row["binder"], row["lane"], f"{ours:.5f}", f"{theirs:.4f}", f"{ours / theirs - 1:+.1e}"


def _rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def _holds(interval: tuple[float, float], truth: float) -> bool:
    low, high = interval
    return not (truth < low or truth > high)  # NaN: no bound


def _white(random: np.random.Generator, count: int) -> np.ndarray:
    return random.normal(size=count)


def _correlated(random: np.random.Generator, count: int) -> np.ndarray:
    """First-order autoregression of unit variance with ρ = exp(−1/5)."""
    rho, out = np.exp(-0.2), random.normal(size=count)
    for k in range(1, count):
        out[k] = rho * out[k - 1] + np.sqrt(1 - rho**2) * out[k]
    return out

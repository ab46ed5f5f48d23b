"""From a creep record to the mastic's Burgers model and its relaxation modulus, at one temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.burgers_fit import BurgersFit, fit_burgers
from pipeline.materials.interconversion import relaxation_of
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.master_curve import MasterCurve, creep_master_curve
from pipeline.materials.prony import PronySeries
from pipeline.materials.series_fit import fit_creep, spaced_times
from pipeline.materials.shift_laws import Arrhenius, ShiftLaw, Wlf, fit_arrhenius, fit_wlf
from pipeline.store.bundle import Bundle
from pipeline.store.creep import FILE, CreepRecord

KELVIN = 273.15
POOR_FIT = 0.05  # rms of ln D; a laboratory reads better than this


@dataclass(frozen=True)
class CreepAnalysis:
    """What a creep record says at one temperature.

    Parameters
    ----------
    record : CreepRecord
    temperature_c : float, °C, or None where the record names none
    time : (n,) array, s; of the readings, brought to that temperature
    window : s; first and last time that Burgers was fitted to
    fit : BurgersFit
    chain : KelvinChain; of all readings
    series : PronySeries; its exact relaxation modulus
    master : MasterCurve, or None with one temperature
    laws : fitted shift laws by name, "wlf" and "arrhenius"
    warnings : sentences
    """

    record: CreepRecord
    temperature_c: float | None
    time: np.ndarray
    window: tuple[float, float]
    fit: BurgersFit
    chain: KelvinChain
    series: PronySeries
    master: MasterCurve | None
    laws: dict[str, ShiftLaw]
    warnings: tuple[str, ...]

    @property
    def burgers(self) -> Burgers:
        """The model of the mastic."""
        return self.fit.model


def analyse_creep(
    record: CreepRecord, temperature_c: float | None = None, window: tuple[float, float] | None = None
) -> CreepAnalysis:
    """Shift the temperatures onto one, and fit there.

    Several temperatures become a master curve at the measured one nearest to `temperature_c`, moved from there
    to `temperature_c` itself by the better of WLF and Arrhenius. The series is fitted to all of it, the
    Burgers model, which has one retardation time only, to the part within `window`.

    Parameters
    ----------
    record : CreepRecord
    temperature_c : float, °C; the temperature of the fracture test. None: the only one, or that in the middle
    window : (first, last) s at that temperature; None: the times at which was read

    Raises
    ------
    InputError
        for a temperature that the record does not reach, and as `fit_burgers`, `creep_master_curve`
    """
    levels = None if record.temperature_c is None else np.unique(record.temperature_c)
    target = _target(levels, temperature_c)
    master, laws, time = None, dict[str, ShiftLaw](), record.time
    warnings: list[str] = []
    if levels is not None and levels.size > 1 and target is not None:
        kelvin = _kelvin(record)
        reference = float(kelvin[np.argmin(np.abs(kelvin - KELVIN - target))])
        master = creep_master_curve(record.time, record.compliance, kelvin, reference)
        laws = _laws(master, warnings)
        time = master.abscissa * 10 ** _to_target(master, laws, target + KELVIN)
    window = (float(record.time.min()), float(record.time.max())) if window is None else window
    used = (time >= window[0] * (1 - 1e-9)) & (time <= window[1] * (1 + 1e-9))
    fit = fit_burgers(time[used], record.compliance[used])
    chain = fit_creep(time, record.compliance, spaced_times(time.min(), time.max()))
    warnings += _doubts(fit, master)
    return CreepAnalysis(record, target, time, window, fit, chain, relaxation_of(chain), master, laws, tuple(warnings))


def mastic_creep(bundle: Bundle) -> CreepAnalysis:
    """What creep.csv of a bundle says of its mastic at the temperature of the test.

    A record that names no temperature is taken as measured at that of the test.

    Raises
    ------
    InputError
        where there is no record, it does not reach the temperature, or that is not stated
    """
    record, wanted = bundle.creep, bundle.loading.temperature_c
    if record is None:
        raise InputError(f"{bundle.name} has no {FILE}: add the creep compliance of the mastic")
    if record.temperature_c is None:
        wanted = None
    elif wanted is None and np.unique(record.temperature_c).size > 1:
        raise InputError(f"experiment.toml: [loading] temperature_c is missing: {FILE} holds several temperatures")
    try:
        return analyse_creep(record, wanted)
    except InputError as error:
        raise InputError(f"{FILE}: {error}") from error


def _target(levels: np.ndarray | None, wanted: float | None) -> float | None:
    """The temperature (°C) at which the answer is wanted; refuses one that was not reached."""
    if levels is None:
        if wanted is not None:
            raise InputError(
                f"the record names no temperature, so nothing can be said at {wanted:g} °C: add a column temperature_c"
            )
        return None
    if wanted is None:
        return float(levels[levels.size // 2])
    if levels[0] <= wanted <= levels[-1]:
        return float(wanted)
    known = f"only {levels[0]:g} °C" if levels.size == 1 else f"{levels[0]:g} to {levels[-1]:g} °C"
    raise InputError(f"{wanted:g} °C lies outside the record, {known}: measure creep at the temperature of the test")


def _kelvin(record: CreepRecord) -> np.ndarray:
    assert record.temperature_c is not None
    return record.temperature_c + KELVIN


def _laws(master: MasterCurve, warnings: list[str]) -> dict[str, ShiftLaw]:
    """Arrhenius, and WLF where there are enough temperatures and the shifts bend that way."""
    laws = {"arrhenius": fit_arrhenius(master)}
    if master.temperature.size > 2:
        try:
            laws["wlf"] = fit_wlf(master)
        except InputError as error:
            warnings.append(f"no WLF law: {error}")
    return laws


def better_law(laws: dict[str, ShiftLaw]) -> Wlf | Arrhenius:
    """The law that lies nearer to the free shifts."""
    return min(laws.values(), key=lambda law: law.rms).law


def _to_target(master: MasterCurve, laws: dict[str, ShiftLaw], kelvin: float) -> float:
    """log₁₀ a_T of the target against the reference: free where it was measured, else by the better law."""
    at = int(np.argmin(np.abs(master.temperature - kelvin)))
    if abs(float(master.temperature[at]) - kelvin) < 1e-6:
        return float(master.log_shift[at])
    return float(better_law(laws).log_shift(np.array(kelvin)))


def _doubts(fit: BurgersFit, master: MasterCurve | None) -> list[str]:
    """What a reader must know before using the constants."""
    said = []
    if fit.unbounded:
        said.append(f"The record does not bound {' and '.join(fit.unbounded)} on at least one side.")
    if fit.rms_log_error > POOR_FIT:
        said.append(
            f"The Burgers model misses the readings by {fit.rms_log_error:.1%} (rms): one retardation time is too "
            "little for so many decades; narrow the window to the duration of the fracture test."
        )
    for low, high in () if master is None else master.apart:
        said.append(
            f"The readings at {low - KELVIN:.4g} and {high - KELVIN:.4g} °C have no compliance in common: their "
            "shift rests on extrapolation; measure longer, or at a temperature between."
        )
    return said

"""Figures of a diagnosis: where, which, how far, and what could not have been seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from pipeline.core.units import KN, MM, UM
from pipeline.gap.observation import STAGES, Observation, Reading
from pipeline.gap.where import GROUP_NAMES, REGIONS
from pipeline.report.style import BLACK, BLUE, GREEN, GREY, LIGHT, MEASURED, ORANGE, VERMILION, colour_bar

LOAD = "load"
COLOURS = (ORANGE, BLUE, GREEN, VERMILION)  # the model as it is, the first explanation, the runners-up


def where_map(axes: Axes, cells: Sequence[Mapping[str, Any]], stage: str, against: str = "z_gap") -> Axes:
    """Region × mode of one stage, and the load: how many times what honest engines (or noise alone) would give.

    Below the ratio stands the size itself, of displacements in µm.

    Parameters
    ----------
    cells : rows of `where` in result.json
    stage : str
    against : "z_gap" or "z_noise"
    """
    regions = [r for r in REGIONS if any(c["region"] == r for c in cells)]
    modes = [m for m in GROUP_NAMES if any(c["mode"] == m for c in cells)]
    rows, columns = [*regions, LOAD], modes or ["all"]
    table = np.full((len(rows), len(columns)), np.nan)
    worst = max([4.0, *(c[against] for c in cells)])
    for cell in (c for c in cells if c["stage"] == stage):
        of_load = cell["channel"] == LOAD
        row = rows.index(LOAD if of_load else cell["region"])
        column = slice(None) if of_load else columns.index(cell["mode"])
        table[row, column] = cell[against]
        dark = cell[against] > np.sqrt(worst) * 1.5
        axes.text(
            (len(columns) - 1) / 2 if of_load else columns.index(cell["mode"]), row,
            f"{short(cell[against])}×\n{short(cell['rms'])}{' N' if of_load else ''}",
            ha="center", va="center", fontsize=5.5, color="w" if dark else BLACK, linespacing=1.1,
        )  # fmt: skip
    image = axes.imshow(table, cmap="YlOrRd", norm=LogNorm(1.0, worst), aspect="auto")
    axes.set_xticks(range(len(columns)), columns if modes else [""], rotation=35, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.tick_params(length=0)
    axes.set_title(stage)
    if stage == STAGES[-1]:
        ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if t <= worst]
        bar = colour_bar(axes, image, "× expected")
        bar.set_yticks(ticks, [str(t) for t in ticks])
        bar.minorticks_off()
    return axes


def load_difference(axes: Axes, observation: Observation, reading: Reading, std: np.ndarray) -> Axes:
    """Measured minus simulated load at every station, beside what noise and engines give.

    Parameters
    ----------
    observation : Observation
    reading : Reading of the simulation
    std : (s,) array, N; of noise and discrepancy, NaN where nothing is judged
    """
    at, left = observation.sight.cmod / MM, observation.reading.load - reading.load
    for width, label in ((2 * std, "± 2 std of noise and engines"), (2 * observation.load_std, "± 2 std of noise")):
        axes.fill_between(at, -width, width, alpha=0.45, linewidth=0, label=label,
                          color=LIGHT if label.endswith("engines") else GREY)  # fmt: skip
    axes.plot(at, left, "o-", ms=3, color=ORANGE, label="measured − simulated")
    axes.axhline(0, color=GREY, linewidth=0.6)
    starts = np.flatnonzero(np.diff(observation.sight.stage, prepend=-1))
    for k, place in enumerate(starts):  # what comes before the peak is short: it ends where the next begins
        early = k == 0 and starts.size > 1
        x, name = at[starts[1] if early else place], STAGES[observation.sight.stage[place]]
        axes.text(x, 1.01, f"{name}  " if early else name, fontsize=6, color=GREY, ha="right" if early else "left",
                  va="bottom", transform=axes.get_xaxis_transform())  # fmt: skip
    axes.set(xlabel="CMOD (mm)", ylabel="difference of load (N)")
    axes.legend(fontsize=6, loc="best")
    return axes


def difference_map(
    axes: Axes, observation: Observation, reading: Reading, std: np.ndarray, stage: int, longest: float
) -> Axes:
    """Measured minus simulated at every point of one stage, as arrows, coloured by standard deviations.

    Parameters
    ----------
    observation : Observation
    reading : Reading of the simulation
    std : (s, p) array, m; of noise and discrepancy, NaN where nothing is judged
    stage : int; number in STAGES: its last station with data is shown
    longest : float, m; the longest arrow of all stages
    """
    sight = observation.sight
    left = observation.reading.field - reading.field
    known = np.isfinite(left.sum(axis=2)) & np.isfinite(std)
    stations = np.flatnonzero((sight.stage == stage) & known.any(axis=1))
    axes.set_title(STAGES[stage])
    axes.plot(*sight.points.T / MM, ".", color=LIGHT, markersize=3)
    axes.plot(*sight.tip / MM, "v", color=BLACK, markersize=4)
    axes.set(xlabel="$x$ (mm)", ylabel="$y$ (mm)", aspect="equal")
    room = 0.3 * max(float(np.ptp(sight.points[:, 0])), 5 * MM) / MM
    (x0, y0), (x1, y1) = sight.points.min(axis=0) / MM, sight.points.max(axis=0) / MM
    axes.set(xlim=(x0 - room, x1 + room), ylim=(min(y0, sight.tip[1] / MM) - room, y1 + room))
    if not stations.size:
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", color=GREY)
        return axes
    k = stations[-1]
    use = known[k]
    size = np.hypot(*left[k, use].T) / (np.sqrt(2) * std[k, use])
    arrows = axes.quiver(
        *sight.points[use].T / MM, *left[k, use].T / MM, size, angles="xy", scale_units="xy",
        scale=longest / MM / (0.8 * room), cmap="YlOrRd", norm=Normalize(0, 4), width=0.012, edgecolor=GREY,
        linewidth=0.3,
    )  # fmt: skip
    typical = np.sqrt(np.mean(np.sum(left[k, use] ** 2, axis=1))) / UM
    axes.set_title(f"{STAGES[stage]}, CMOD {sight.cmod[k] / MM:.3f} mm: {typical:.2g} µm")
    if stage == len(STAGES) - 1:
        colour_bar(axes, arrows, "standard deviations")
    return axes


def ranking(
    axes: Axes, probability: Mapping[str, float], each: Mapping[str, Mapping[str, float]] | None = None, most: int = 8
) -> Axes:
    """Probabilities of the best explanations; of every test by itself as points, where there are several."""
    rows = sorted(probability.items(), key=lambda item: -item[1])[:most][::-1]
    axes.barh([_broken(n) for n, _ in rows], [p for _, p in rows],
                     color=[GREY if n == "none" else BLUE for n, _ in rows])  # fmt: skip
    for place, (_, p) in enumerate(rows):
        axes.text(1.2, place, f"{p:.2f}" if p >= 0.005 else "<0.01", ha="right", va="center", fontsize=6)
    for points in (each or {}).values():
        axes.plot([points.get(n, np.nan) for n, _ in rows], range(len(rows)), "o", mfc="none", color=BLACK, ms=3.5)
    axes.axvline(0.8, color=VERMILION, linewidth=0.8, linestyle="--")
    axes.tick_params(axis="y", labelsize=6.5)
    axes.set(xlabel="probability (dashed: a cause is named)", xlim=(0, 1.2), xticks=np.linspace(0, 1, 6))
    return axes


def detectability(axes: Axes, limits: Mapping[str, Mapping[str, Any]], threshold: float) -> Axes:
    """d′ of every effect at its plausible maximum; below the line it would never be seen."""
    rows = sorted(limits.items(), key=lambda item: item[1]["d_prime_at_most"])
    values = np.maximum([row["d_prime_at_most"] for _, row in rows], 0.1)
    axes.barh([n for n, _ in rows], values, color=[BLUE if v >= threshold else LIGHT for v in values])
    axes.axvline(threshold, color=VERMILION, linewidth=0.8, linestyle="--")
    axes.set(xscale="log", xlabel="d′ at the plausible maximum (dashed: seen from here)", xlim=(0.1, None))
    axes.tick_params(axis="y", labelsize=6)
    return axes


def closures(axes: Axes, found: Mapping[str, Mapping[str, Any]]) -> Axes:
    """How far explanations close the gap on held-out data, with 95 % intervals; whole, field and load."""
    ticks = {}
    for place, (label, row) in enumerate(list(found.items())[::-1]):
        ticks[place] = _broken(label)
        channels = row.get("channels", {})
        parts = {"all data": row, **(channels if len(channels) > 1 else {})}
        for k, (name, part) in enumerate(parts.items()):
            if part["fraction"] is None:
                continue
            at, colour = place + 0.2 - 0.2 * k, (BLACK, BLUE, ORANGE)[k]
            low, high = part["interval_95"]
            axes.plot([low, high], [at, at], color=colour, linewidth=1.0)
            axes.plot(part["fraction"], at, "osD"[k], color=colour, markersize=4, label=name)
    axes.set_yticks(list(ticks), list(ticks.values()), fontsize=6.5)
    axes.axvline(0, color=GREY, linewidth=0.6)
    axes.axvline(1, color=GREY, linewidth=0.6, linestyle="--")
    axes.set(xlabel="share of the gap closed on held-out data", xlim=(-0.6, 1.6), ylim=(-0.6, len(ticks) - 0.4))
    _legend_once(axes)
    return axes


def loads(
    axes: Axes,
    observation: Observation,
    curves: Mapping[str, tuple[np.ndarray, np.ndarray]],
    record: tuple[np.ndarray, np.ndarray] | None = None,
    std: np.ndarray | None = None,
) -> Axes:
    """Load–CMOD: the record, the stations that are compared, and simulated curves.

    Parameters
    ----------
    observation : Observation
    curves : name → CMOD (k,), m, and load (k,), N; the model as it is first
    record : CMOD (n,), m, and load (n,), N, as measured
    std : (s,) array, N; of noise and discrepancy at the stations
    """
    at, load = observation.sight.cmod, observation.reading.load
    if record is not None:
        inside = record[0] <= 1.05 * at[-1]
        axes.plot(record[0][inside] / MM, record[1][inside] / KN, color=LIGHT, linewidth=2.2, zorder=0)
    if std is not None:
        axes.fill_between(at / MM, (load - 2 * std) / KN, (load + 2 * std) / KN, color=LIGHT, alpha=0.45, linewidth=0,
                          label="± 2 std of noise and engines")  # fmt: skip
    axes.plot(at / MM, load / KN, "o", color=MEASURED, markersize=4, label="measured")
    for (name, (cmod, values)), colour in zip(curves.items(), COLOURS, strict=False):
        axes.plot(cmod / MM, values / KN, color=colour, label=name)
    axes.set(xlabel="CMOD (mm)", ylabel="load (kN)", ylim=(0, None), xlim=(0, None))
    axes.legend(fontsize=6)
    return axes


def differences(axes: Axes, observation: Observation, readings: Mapping[str, Reading], std: np.ndarray) -> Axes:
    """Root mean square difference of displacements at every station, beside noise and what engines differ by.

    Parameters
    ----------
    observation : Observation
    readings : name → Reading; the model as it is first
    std : (s, p) array, m; of noise and discrepancy, NaN where nothing is judged
    """
    at, whole = observation.sight.cmod / MM, np.sqrt(2) * UM**-1
    axes.fill_between(at, 0, 2 * whole * _mean(std), color=LIGHT, alpha=0.45, linewidth=0,
                      label="2 std of noise and engines")  # fmt: skip
    for (name, reading), colour in zip(readings.items(), COLOURS, strict=False):
        left = np.where(np.isfinite(std)[..., None], observation.reading.field - reading.field, np.nan)
        axes.plot(at, _mean(np.sqrt(np.sum(left**2, axis=2))) / UM, "o-", ms=3, color=colour, label=name)
    axes.plot(at, whole * _mean(np.where(np.isfinite(std), observation.field_std, np.nan)), color=GREY,
              linestyle=":", label="noise")  # fmt: skip
    axes.set(xlabel="CMOD (mm)", ylabel="difference of displacement (µm)", ylim=(0, None))
    axes.legend(fontsize=6)
    return axes


def forest(axes: Axes, rows: Mapping[str, tuple[float, float, float]], label: str) -> Axes:
    """One value with its interval a row.

    Parameters
    ----------
    rows : name → value, low, high
    label : str; of the abscissa, with the unit
    """
    for place, (_, (value, low, high)) in enumerate(list(rows.items())[::-1]):
        axes.plot([low, high], [place, place], color=GREY)
        axes.plot(value, place, "o", color=BLUE, markersize=4)
    axes.set_yticks(range(len(rows)), list(rows)[::-1])
    axes.axvline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylim=(-0.6, len(rows) - 0.4))
    return axes


def _mean(values: np.ndarray) -> np.ndarray:
    """Root mean square over points (s,), of (s, p); NaN where there are none."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    total = np.where(known, values, 0.0) ** 2
    return np.sqrt(np.divide(total.sum(axis=1), count, out=np.full(len(values), np.nan), where=count > 0))


def short(value: float) -> str:
    """Two digits, without powers of ten."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def _broken(label: str) -> str:
    """A label of two effects on two lines."""
    return label.replace(" + ", "\n+ ")


def _legend_once(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    first = dict(zip(labels[::-1], handles[::-1], strict=True))
    if first:
        axes.legend(first.values(), first.keys(), fontsize=6, loc="lower left")

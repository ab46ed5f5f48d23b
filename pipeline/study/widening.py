"""An estimation with a third and a fourth parameter, beside the one of (f_max, delta_max)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.core.problem import Problem
from pipeline.inverse.estimate import Estimate
from pipeline.inverse.objective import Objective
from pipeline.inverse.observations import Simulated
from pipeline.inverse.sparse import SparseGrid
from pipeline.inverse.widened import Widened, widen
from pipeline.materials.mixture import Mixture
from pipeline.study.campaign import Campaign, how_to

KEYS = {"f_max": "f_max_n", "delta_max": "delta_max_m", "mastic_modulus": "mastic_modulus_pa"}
"""Names in result.json, where they differ from those in the settings."""


def widening(campaign: Campaign, found: Estimate) -> Widened | None:
    """Simulate a sparse grid about the optimum and estimate all its parameters; None where no more are asked for."""
    settings = campaign.settings
    names = ("f_max", "delta_max", *settings.more_parameters)
    if len(names) == 2 or not found.accepted:
        return None
    centre = np.array([found.f_max, found.delta_max, *(_nominal(campaign.model.mixture, n) for n in names[2:])])
    grid = SparseGrid(centre, settings.more_parameters_range * centre)
    campaign.progress.stage(f"{len(grid.nodes)} simulations of {len(names)} parameters")
    runs = campaign.solved([(_told(names, node), varied(campaign, names, node)) for node in grid.nodes])
    seen = None
    if found.settings.objective is not Objective.LOAD:
        seen = np.stack(campaign.seen(runs))[:, None]
    loads = np.stack([solution.curve.load_at(campaign.measured.cmod) for _, solution in runs])[:, None]
    how = how_to(settings, found.settings.objective)
    return widen(names, grid, Simulated(seen, loads), campaign.measured, how, found.placements)


def varied(campaign: Campaign, names: Sequence[str], values: np.ndarray) -> Problem:
    """The test at values of f_max (N), delta_max (m) and of further properties of the mixture."""
    more = {name: float(value) for name, value in zip(names[2:], values[2:], strict=True)}
    model = replace(campaign.model, mixture=replace(campaign.model.mixture, **more))  # type: ignore[arg-type]
    return campaign.problem_of(model, float(values[0]), float(values[1]))


def widened_result(found: Widened | None) -> dict[str, Any] | None:
    """The estimates by the keys of result.json."""
    if found is None:
        return None
    keys = [KEYS.get(name, name) for name in found.names]
    return {
        "values": dict(zip(keys, found.minimum.position.tolist(), strict=True)),
        "interval_95": dict(zip(keys, found.intervals.tolist(), strict=True)),
        "determined": dict(zip(keys, found.determined.tolist(), strict=True)),
        "correlation": found.correlation,
        "objective_min": found.minimum.value,
        "interior": found.minimum.interior,
        "simulations": len(found.grid.nodes),
    }


def widened_lines(found: Widened | None) -> list[str]:
    """The estimates in words, one a line, with what a reader must know of them."""
    if found is None:
        return []
    rows = zip(found.names, found.minimum.position, found.intervals, strict=True)
    together = "; ".join(f"{name} = {value:.4g} (95 %: {low:.4g} to {high:.4g})" for name, value, (low, high) in rows)
    return [f"together with more parameters: {together}", *found.warnings]


def _nominal(mixture: Mixture, name: str) -> float:
    return float(getattr(mixture, name))


def _told(names: Sequence[str], values: np.ndarray) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, values, strict=True))

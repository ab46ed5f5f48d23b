"""A virtual test in speckle images that is made in seconds: a coarse network, small pictures, a coarse grid."""

from __future__ import annotations

from pathlib import Path

from helpers.bundles import coarse_experiment
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.study.virtual_test import virtual_test

MM_PER_PX = 0.16
STEP_PX = 8
FRAMES = 25


def make_film(folder: Path, seed: int = 3) -> Path:
    """Break and photograph a network; images, record, truth.json and truth.h5 in `folder`."""
    raw = coarse_experiment("model").model_dump(exclude_none=True)
    raw["dic"] |= {"grid_step_px": STEP_PX}
    like = folder.parent / "like"
    write_bundle(like, Experiment.model_validate(raw), Contents())
    virtual_test(
        folder, like=like, radius_mm=2.0, images=True, camera_mm_per_px=MM_PER_PX, frames=FRAMES, seed=seed, workers=1
    )
    return folder

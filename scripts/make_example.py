#!/usr/bin/env python3
"""Draw the example that ships with the package: a graded section as label image, and the settings of its test."""

import shutil
import sys
from pathlib import Path

import numpy as np

from pipeline.core.units import MM
from pipeline.microstructure.gradation import fuller_section
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, first_experiment, write_bundle

PITCH, MARGIN, RADIUS = 0.1, 5, 0.6  # mm per pixel, pixels around the specimen, mm

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "pipeline/examples/seb")
raw = first_experiment("seb", "example-seb").model_dump(exclude_none=True)
size = raw["specimen"]
columns, rows = (round(size[k] / PITCH) + 1 + 2 * MARGIN for k in ("length_mm", "depth_mm"))
section = fuller_section(columns * PITCH * MM, rows * PITCH * MM, PITCH * MM, np.random.default_rng(2017))
size["image"] = {"mm_per_px": PITCH, "origin_px": [(columns - 1) / 2, rows - 1.0 - MARGIN]}
raw["model"]["particle_radius_mm"] = RADIUS
raw["start"]["f_max_n"] *= RADIUS / 0.3
raw["loading"]["cmod_max_mm"] = 0.6
if folder.exists():
    shutil.rmtree(folder)
write_bundle(folder, Experiment.model_validate(raw), Contents(labels=section.label))
print(f"{folder}: {section.diameter.size} stones")

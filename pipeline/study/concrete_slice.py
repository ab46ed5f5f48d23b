"""A slice of a real concrete tomography as the photograph of a beam: it tries the pipeline, not a size-true concrete.

The volume is a neutron tomography of a cylinder (Stamati et al., JOSS 5 (2020) 2286; Roubin et al., Cem. Concr.
Compos. 104 (2019) 103336). Its largest inscribed square is scaled to the depth of the beam; beyond the square, to the
left and the right, its mirror images go on, so that a whole beam is covered.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import tifffile

from pipeline.core.errors import InputError
from pipeline.store.images import save_png

VOLUME = Path("concrete_ct_spam") / "concrete_neutron-bin16.tif"
CENTRE, RADIUS = (50, 49), 36  # row, column and radius of the cylinder in voxels, as its README states
ENLARGED = 8  # a voxel is 1.2 mm at a depth of 60 mm: interpolated before it is segmented


def slice_photograph(data: Path, z: int, path: Path, depth_mm: float = 60.0) -> float:
    """Write the photograph of a beam of `depth_mm` from slice z of the volume; its scale in mm per pixel.

    Raises
    ------
    InputError
        where the slice is not one of the cylinder
    """
    volume = tifffile.imread(data / VOLUME)
    if not 12 < z < 88:
        raise InputError(f"slice z = {z} lies outside the cylinder: take one between 13 and 87")
    half = int(RADIUS / np.sqrt(2))
    (row, column), square = CENTRE, volume[z].astype(np.float32)
    square = square[row - half : row + half, column - half : column + half]
    large = cv2.resize(square, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    tiled = np.hstack([large[:, ::-1], large, large[:, ::-1]])
    low, high = np.percentile(square, [0.5, 99.5])
    save_png(path, np.clip((tiled - low) / (high - low) * 255, 0, 255).astype(np.uint8))
    return depth_mm / (2 * half * ENLARGED)

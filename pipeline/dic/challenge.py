"""Images of the DIC Challenge, of a real composite and of a real crack: measured against the numbers beside them.

Truth and tolerances are those of the READMEs in the folders of the data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from pipeline.dic.benchmark import Row
from pipeline.dic.correlate import Reference, correlate
from pipeline.dic.crack import find_crack
from pipeline.dic.settings import Settings
from pipeline.dic.status import Status

Read = Callable[[Path], np.ndarray]

_RIGID = {"Sample5-000_X0.00_Y0.00_N2_C75_R10.tif": 0.0, "Sample5-001_X0.10_Y0.10_N2_C100_R20.tif": 0.1}
_TIPS = ((40, 128), (99, 129), (155, 122))  # column, row; labelled by hand
_HOLE, _AWAY = (194, 543), 90  # px; centre, and radius within which two other codes differ


def challenge(data: Path, read: Read) -> Iterator[Row]:
    """All of them; `data` holds their folders, `read` gives the grey values of a file."""
    yield from rigid_shift(data / "dic1_sample05", read)
    yield from sinusoids(data / "dic1_sample14", read)
    yield from star(data / "dic2_star5", read)
    yield from composite(data / "dic1_sample12_ohtcfrp", read)
    yield from fatigue_crack(data / "crackpy_dic_crack")


def _under(name: str, value: float, limit: float) -> Row:
    return Row(name, value, f"< {limit:g}", value < limit)


def rigid_shift(folder: Path, read: Read) -> Iterator[Row]:
    """DIC Challenge 1.0, sample 5: a shift of 0.1 px under changing light."""
    reference = Reference(read(folder / "Sample5_Reference.tif"), Settings(threads=1))
    found = [(reference.correlate(read(folder / name)).displacement, shift) for name, shift in _RIGID.items()]
    bias = max(float(np.abs(np.nanmean(moved, axis=0) - shift).max()) for moved, shift in found)
    yield _under("sample 5: bias, px", bias, 0.005)
    yield _under("sample 5: noise, px", max(float(np.nanstd(moved, axis=0).max()) for moved, _ in found), 0.008)


def sinusoids(folder: Path, read: Read) -> Iterator[Row]:
    """DIC Challenge 1.0, sample 14: sinusoids of 0.1 px, rising in frequency; three rows averaged."""
    from scipy.io import loadmat

    exact = next(v for k, v in loadmat(folder / "Sample14Exact.mat").items() if not k.startswith("_"))
    reference = read(folder / "Sample14_Reference.tif")
    rms, bias, slope = [], [], []
    for level in (1, 3, 5):
        deformed = read(folder / f"Sample14_L{level}_Amp0.1b.tif")
        rows = [correlate(reference, deformed, Settings(roi_px=(0, r, 2048, 1), threads=1)) for r in (150, 300, 450)]
        moved = np.nanmean([found.displacement[:, 0] for found in rows], axis=0)
        truth = exact[rows[0].grid.columns, level]
        rms.append(float(np.sqrt(np.mean((moved - truth) ** 2))))
        bias.append(float(abs(np.mean(moved - truth))))
        slope.append(float(abs(np.polyfit(truth, moved, 1)[0] - 0.99)))  # 0.93 to 1.05
    yield _under("sample 14, worst of three levels: rms, px", max(rms), 0.015)
    yield _under("sample 14: bias, px", max(bias), 0.004)
    yield _under("sample 14: slope of regression, off 0.99 by", max(slope), 0.06)


def star(folder: Path, read: Read) -> Iterator[Row]:
    """DIC Challenge 2.0, star 5: v = 0.5 cos(2π (y − 250)/p), the period p growing from 10 to 300 px."""
    before, after = (read(folder / f"DIC_Challenge_Star_Noise_{name}.tiff") for name in ("Ref", "Def"))
    found = correlate(before, after, Settings(roi_px=(1975, 0, 2025, 501), grid_step_px=12, threads=1))
    column, row = found.points.T
    truth = 0.5 * np.cos(2 * np.pi * (row - 250) / (10 + 290 / 4000 * column))
    yield _under("star 5, wide half: rms of v, px", _rms(found.displacement[:, 1] - truth), 0.02)
    yield _under("star 5, wide half: rms of u (noise), px", _rms(found.displacement[:, 0]), 0.01)
    table = np.genfromtxt(folder / "centre_row_reference.csv", delimiter=",", skip_header=1)
    found = correlate(before, after, Settings(roi_px=(0, 240, 4000, 21), grid_step_px=5, threads=1))
    middle = (found.points[:, 1] == 250) & (found.status == Status.OK)
    table = table[table[:, 2] > 45]  # below, an affine subset sees a whole wave, and says that it does not match
    _, ours, theirs = np.intersect1d(found.points[middle, 0], table[:, 0], return_indices=True)
    off = np.abs(found.displacement[middle, 1][ours] - table[theirs, 6])
    yield _under("star 5, periods over 45 px: off the same estimator, px", float(off.max()), 0.03)
    middle = found.points[:, 1] == 250
    place = found.points[middle, 0]
    period = 10 + 290 / 4000 * place
    passed = np.array([np.median(found.warp[middle, 1][np.abs(period - p) < 2]) for p in range(20, 80)])
    yield Row("star 5: half the amplitude passes at a period of, px", 20.0 + int(np.argmax(passed > 0.25)), "", None)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def composite(folder: Path, read: Read) -> Iterator[Row]:
    """DIC Challenge 1.0, sample 12: a real composite with a hole in tension, against two other codes."""
    settings = Settings(subset_size_px=27, grid_step_px=7, threads=1)
    reference = Reference(read(folder / "oht_cfrp_00.tiff"), settings)
    rms, share = [], []
    for frame in (4, 8, 11):
        found = reference.correlate(read(folder / f"oht_cfrp_{frame:02d}.tiff"))
        theirs = np.genfromtxt(folder / f"DICe_solution_{frame:02d}.txt", delimiter=",", skip_header=21)
        theirs = theirs[np.hypot(*(theirs[:, :2] - _HOLE).T) > _AWAY]
        moved, _, valid = found.at(theirs[:, :2])
        share.append(float(valid.mean()))
        rms.append(float(np.sqrt(np.mean((moved - theirs[:, 2:4])[valid] ** 2, axis=0)).max()))
        if frame == 4:
            name = "OpenCorr_icgn1_r16_frame04_fullframe_coords_step4.csv"
            other = np.genfromtxt(folder / name, delimiter=",", skip_header=1)
            other = other[np.hypot(*(other[:, :2] - _HOLE).T) > _AWAY]
            moved, _, valid = found.at(other[:, :2])
            second = float(np.sqrt(np.mean((moved - other[:, 2:4])[valid] ** 2, axis=0)).max())
    yield _under("composite, frames 4, 8, 11: rms against DICe, px", max(rms), 0.015)
    yield _under("composite, frame 4: rms against OpenCorr, px", second, 0.015)
    yield Row("composite: their points that have a result", min(share), "", None)


def fatigue_crack(folder: Path) -> Iterator[Row]:
    """Measured fields across a real fatigue crack, path and tip labelled by hand."""
    data = np.load(folder / "dic_crack_fields.npz")
    rows, columns = np.mgrid[:256, :256]
    points = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    path, tip = [], []
    for stage, at in enumerate(_TIPS):
        crack = find_crack(points, np.moveaxis(data["disp_mm"][stage], 0, -1).reshape(-1, 2))
        label = np.argwhere(data["label"][stage] == 1)[:, ::-1]
        path.append(float(np.quantile(cKDTree(label).query(crack.path)[0], 0.85)))
        tip.append(float(np.linalg.norm(crack.tip - at)))
    yield _under("fatigue crack, three stages: path off the label, px", max(path), 3)
    yield _under("fatigue crack: tip off the label, px", max(tip), 8)

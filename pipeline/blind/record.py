"""What machine, clip gauge and camera write down of a broken body, with what spoils it and noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.blind.equilibrium import Path, Setup
from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.core.specimen import Specimen

MEASUREMENT = frozenset(
    {
        "fixture_compliance_um_per_kn", "sync_offset_s", "cmod_gain", "magnification", "lens_distortion",
        "drift_um_per_min", "load_gain",
    }
)  # fmt: skip
TORN = 0.1  # of an edge's last opening: from there on its triangles are not measured as one surface


@dataclass(frozen=True)
class Camera:
    """When and where displacements are measured, and how well.

    Parameters
    ----------
    time : (k,) array, s; of the frames, on the record's clock; the first ones of the unloaded specimen
    points : (n, 2) array, m
    centre : (2,) array, m; of the view
    corner : float, m; half its diagonal
    displacement_std, load_std : float, m and N
    rate : float, 1/s; rows of the load record per second
    rest : float, s; record before the loading
    heading : float, rad; direction of a drift
    """

    time: np.ndarray
    points: np.ndarray
    centre: np.ndarray
    corner: float
    displacement_std: float
    load_std: float
    rate: float = 5.0
    rest: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True, eq=False)
class Recorder:
    """A test that was broken, and what the record does not say of how it is recorded.

    Parameters
    ----------
    setup, path : the test
    specimen : Specimen; as the record says it is
    camera : Camera
    spoiling : measurement effect → value
    """

    setup: Setup
    path: Path
    specimen: Specimen
    camera: Camera
    spoiling: Mapping[str, float]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.spoiling) - MEASUREMENT)
        if unknown:
            raise InputError(f"{', '.join(unknown)} does not act on a record: it must be one of {sorted(MEASUREMENT)}")

    def _value(self, name: str) -> float:
        return self.spoiling.get(name, 0.0)

    @property
    def end(self) -> float:
        """Time (s) at which the record ends."""
        return self.camera.rest + float(self.path.cmod[-1]) / self.setup.cmod_rate

    def cmod_at(self, time: np.ndarray) -> np.ndarray:
        """True CMOD (m) at times of the record (s): at rest, then a ramp."""
        return np.clip((np.asarray(time) - self.camera.rest) * self.setup.cmod_rate, 0.0, self.path.cmod[-1])

    def moved_at(self, time: float) -> np.ndarray:
        """Nodal displacements (nodes, 2), m, at a time of the record (s)."""
        return self._between(self.path.moved, time).reshape(-1, 2)

    def reached_at(self, time: float) -> np.ndarray:
        """Largest openings (q,), m."""
        return self._between(self.path.reached, time)

    def _between(self, rows: np.ndarray, time: float) -> np.ndarray:
        cmod = float(self.cmod_at(np.array([time]))[0])
        k = int(np.clip(np.searchsorted(self.path.cmod, cmod), 1, len(rows) - 1))
        low, high = self.path.cmod[k - 1 : k + 1]
        share = (cmod - low) / (high - low)
        mixed: np.ndarray = (1 - share) * rows[k - 1] + share * rows[k]
        return mixed

    def curve(self, rng: np.random.Generator) -> LoadCurve:
        """The machine's record."""
        time = np.arange(int(self.end * self.camera.rate) + 1) / self.camera.rate
        cmod = self.cmod_at(time)
        load = np.interp(cmod, self.path.cmod, self.path.load) * (1 + self._value("load_gain"))
        line = np.interp(cmod, self.path.cmod, self.path.machine)
        noise = self.camera.load_std * rng.standard_normal(time.size)
        return LoadCurve(
            time=time,
            cmod=cmod * (1 + self._value("cmod_gain")),
            load=load + noise,
            load_line=line,
            load_std=np.full(time.size, self.camera.load_std),
        )

    def seen(self, places: np.ndarray, moved: np.ndarray, time: float) -> np.ndarray:
        """Where the camera sees material (n, 2) that stands at `places` and has moved by `moved`, m."""
        at = places + moved + self._carried(time)
        cmod = float(self.cmod_at(np.array([time]))[0])
        grown = 1 + self._value("magnification") * cmod / float(self.path.cmod[-1])
        arm = grown * (at - self.camera.centre)
        bent = 1 + self._value("lens_distortion") * np.sum(arm**2, axis=1, keepdims=True) / self.camera.corner**2
        return self.camera.centre + bent * arm

    def _carried(self, time: float) -> np.ndarray:
        """Motion (2,), m, of the whole specimen: it drifts from the record's first row on, and its fixture yields."""
        cmod = float(self.cmod_at(np.array([time]))[0])
        load = float(np.interp(cmod, self.path.cmod, self.path.load))
        pull = np.array([0.0, -1.0]) if self.specimen.geometry == "seb" else np.array([1.0, 0.0])
        way = np.array([np.cos(self.camera.heading), np.sin(self.camera.heading)])
        drift = self._value("drift_um_per_min") * 1e-6 / 60 * max(time, 0.0)
        return self._value("fixture_compliance_um_per_kn") * 1e-9 * load * pull + drift * way

    def stamped(self) -> np.ndarray:
        """The times (k,), s, that the frames are given."""
        return self.camera.time + self._value("sync_offset_s")

    def field(self, rng: np.random.Generator) -> DisplacementField:
        """What correlation of the frames would find, by the affine motion of each point's triangle."""
        mesh, places = self.setup.body.mesh, self.camera.points
        triangle = mesh.triangle_at(places)
        there: np.ndarray = np.asarray(triangle >= 0)
        rows = [self.setup.body.row_in(triangle[there], places[there], axis) for axis in np.eye(2)]
        values = np.full((self.camera.time.size, len(places), 2), np.nan)
        valid = np.zeros(values.shape[:2], bool)
        first = self.seen(places[there], np.zeros((there.sum(), 2)), -1.0)
        for k, time in enumerate(self.camera.time.tolist()):
            flat = self.moved_at(time).ravel()
            moved = np.column_stack([row @ flat for row in rows])
            values[k, there] = self.seen(places[there], moved, time) - first
            valid[k, there] = np.logical_not(self._beside_tear(time)[triangle[there]])
        values += self.camera.displacement_std * rng.standard_normal(values.shape)
        values[~valid] = np.nan
        std = np.full(valid.shape, self.camera.displacement_std)
        return DisplacementField(places, values, valid, std, self.stamped())

    def _beside_tear(self, time: float) -> np.ndarray:
        """Triangles (t,) with an edge open all along: the pattern on them is torn."""
        open_ = self.torn_at(time)
        found = np.zeros(len(self.setup.body.mesh.corners), int)
        np.add.at(found, self.setup.body.sides[open_].ravel(), 1)
        return found > 1

    def torn_at(self, time: float) -> np.ndarray:
        """Edges (c,) that have opened by a tenth of their last opening."""
        share: np.ndarray = np.asarray(self.reached_at(time) > TORN * self.setup.edges.last)
        return np.asarray(share.reshape(-1, 2).all(axis=1))

    def sheet(self, time: float) -> Sheet:
        """The surface as the camera sees it at a time of the record (s)."""
        body = self.setup.body
        corners = body.mesh.points[body.mesh.corners]
        moved = self.moved_at(time)[body.node]
        seen = self.seen(corners.reshape(-1, 2), moved.reshape(-1, 2), time).reshape(-1, 3, 2)
        return Sheet(corners, seen)

    def exactly(self) -> Recorder:
        """The same without noise."""
        return replace(self, camera=replace(self.camera, displacement_std=0.0, load_std=0.0))


@dataclass(frozen=True, eq=False)
class Sheet:
    """Triangles (t, 3, 2) of the material, and where they are seen; in m."""

    material: np.ndarray
    seen: np.ndarray

    def raster(
        self, pixel: np.ndarray, origin: np.ndarray, columns: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Material points seen on a square raster.

        Parameters
        ----------
        pixel : (t, 3, 2) array, px; where the corners are seen
        origin : (t, 3, 2) array, px; where they were
        columns, rows : raster positions, px, equally spaced

        Returns
        -------
        (rows · columns, 2) array, px, NaN where nothing is, and whether there is anything
        """
        step = float(columns[1] - columns[0])
        found = np.full((rows.size, columns.size, 2), np.nan)
        low = np.ceil((pixel.min(axis=1) - (columns[0], rows[0])) / step).astype(int)
        high = np.floor((pixel.max(axis=1) - (columns[0], rows[0])) / step).astype(int)
        low, high = np.maximum(low, 0), np.minimum(high, (columns.size - 1, rows.size - 1))
        for k in np.flatnonzero(np.all(low <= high, axis=1)).tolist():
            _fill(found, pixel[k], origin[k], columns, rows, low[k], high[k])
        flat = found.reshape(-1, 2)
        return flat, np.isfinite(flat[:, 0])


def _fill(
    found: np.ndarray, pixel: np.ndarray, origin: np.ndarray, columns: np.ndarray, rows: np.ndarray, low: np.ndarray,
    high: np.ndarray,
) -> None:  # fmt: skip
    """Write the material points of one triangle into the raster (rows, columns, 2)."""
    x, y = np.meshgrid(columns[low[0] : high[0] + 1], rows[low[1] : high[1] + 1])
    (x0, y0), (x1, y1), (x2, y2) = pixel
    whole = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
    if whole == 0:
        return
    second = ((x - x0) * (y2 - y0) - (y - y0) * (x2 - x0)) / whole
    third = ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / whole
    inside = (second >= -1e-9) & (third >= -1e-9) & (second + third <= 1 + 1e-9)
    place = origin[0] + second[..., None] * (origin[1] - origin[0]) + third[..., None] * (origin[2] - origin[0])
    found[low[1] : high[1] + 1, low[0] : high[0] + 1][inside] = place[inside]

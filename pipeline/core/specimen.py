"""Fracture specimens as data: outline, notch, where they are gripped and where they are protected.

Coordinates: x parallel to the opening direction, y along the notch into the specimen, origin at the
notch mouth on the notch line; metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.units import MM


@dataclass(frozen=True)
class GripRegion:
    """Where a machine part touches the specimen, and what it does there.

    The region is a disk sector: distance to `centre` between `inner` and `outer`, and direction within
    `half_angle` of `axis`. `anchor` is the point whose displacement the grip's weighted mean stands for
    (None: the plain mean).

    Parameters
    ----------
    name : str
    centre : (x, y), m
    inner, outer : float, m
    axis, half_angle : float, rad; half_angle = pi is the full disk
    direction : (x, y), unit vector of the prescribed displacement
    drive : float; 1 moves with the machine, 0 is held
    role : "drive", "react" or "guide"
    anchor_x : float or None, m; the weights are balanced so that their mean x lies here
    """

    name: str
    centre: tuple[float, float]
    inner: float
    outer: float
    axis: float
    half_angle: float
    direction: tuple[float, float]
    drive: float
    role: str
    anchor_x: float | None = None

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which of the points (n, 2) lie in the region; (n,) bool."""
        arm = points - np.asarray(self.centre)
        distance = np.hypot(arm[:, 0], arm[:, 1])
        turn = np.angle(np.exp(1j * (np.arctan2(arm[:, 1], arm[:, 0]) - self.axis)))
        return (distance >= self.inner) & (distance <= self.outer) & (np.abs(turn) <= self.half_angle)


class Specimen(Protocol):
    """What every geometry offers; lengths in m."""

    geometry: ClassVar[str]

    @property
    def thickness(self) -> float: ...
    @property
    def notch_length(self) -> float: ...
    @property
    def notch_width(self) -> float: ...
    @property
    def gauge_length(self) -> float: ...
    @property
    def gauge_y(self) -> float: ...
    @property
    def tip(self) -> tuple[float, float]: ...
    @property
    def ligament_length(self) -> float: ...
    @property
    def bounds(self) -> tuple[float, float, float, float]: ...
    def contains(self, points: np.ndarray) -> np.ndarray: ...
    def grip_regions(self, radius: float) -> tuple[GripRegion, ...]: ...
    def protected(self, points: np.ndarray) -> np.ndarray: ...
    def outline(self) -> list[np.ndarray]: ...


def ligament_area(specimen: Specimen) -> float:
    """Area of the ligament (m²)."""
    return specimen.ligament_length * specimen.thickness


def crosses_notch(specimen: Specimen, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Which segments start → end, each (m, 2), cross the notch line below the tip; (m,) bool.

    A point exactly on the notch line counts as lying on its right.
    """
    right = start[:, 0] >= 0
    crossing = right != (end[:, 0] >= 0)
    run = end[:, 0] - start[:, 0]
    share = np.divide(-start[:, 0], run, out=np.zeros_like(run), where=run != 0)
    height = start[:, 1] + share * (end[:, 1] - start[:, 1])
    return crossing & (height < specimen.tip[1])


def _refuse(checks: list[tuple[bool, str]]) -> None:
    problems = [message for bad, message in checks if bad]
    if problems:
        raise InputError("; ".join(problems))


def _in_notch(specimen: Specimen, points: np.ndarray) -> np.ndarray:
    """Points in a notch of finite width, its end a half circle."""
    half = specimen.notch_width / 2
    if half == 0:
        return np.zeros(len(points), bool)
    beyond = np.maximum(points[:, 1] - (specimen.tip[1] - half), 0)
    return np.hypot(points[:, 0], beyond) < half


def _common_checks(specimen: Specimen) -> list[tuple[bool, str]]:
    mm = {k: v / MM for k, v in vars(specimen).items()}
    positive = [k for k in mm if k not in ("notch_width", "gauge_y", "notch_length")]
    return [
        *((not mm[k] > 0, f"{k}_mm = {mm[k]:g} must be positive") for k in positive),
        (mm["notch_width"] < 0, f"notch_width_mm = {mm['notch_width']:g} must not be negative"),
        (not mm["notch_length"] > 0, f"notch_length_mm = {mm['notch_length']:g} must be positive"),
        (
            mm["gauge_length"] < mm["notch_width"],
            f"gauge_length_mm = {mm['gauge_length']:g} must not be smaller than notch_width_mm = {mm['notch_width']:g}",
        ),
    ]


@dataclass(frozen=True)
class SingleEdgeNotchedBeam:
    """SE(B): a beam in three-point bending, notched at mid-span; lengths in m."""

    depth: float
    span: float
    length: float
    thickness: float
    notch_length: float
    notch_width: float = 0.0
    gauge_length: float = 4 * MM
    gauge_y: float = 0.0

    geometry: ClassVar[str] = "seb"
    contact: ClassVar[float] = 2 * MM  # radius of the half disk over which a roller's force is spread
    guard: ClassVar[float] = 4 * MM  # no damage within this distance of platen and supports

    def __post_init__(self) -> None:
        _refuse(
            [
                *_common_checks(self),
                (
                    self.notch_length >= self.depth,
                    f"notch_length_mm = {self.notch_length / MM:g} reaches outside the specimen: it must be "
                    f"smaller than depth_mm = {self.depth / MM:g}",
                ),
                (
                    self.length < self.span,
                    f"length_mm = {self.length / MM:g} must not be smaller than span_mm = {self.span / MM:g}",
                ),
            ]
        )

    @property
    def tip(self) -> tuple[float, float]:
        return (0.0, self.notch_length)

    @property
    def ligament_length(self) -> float:
        return self.depth - self.notch_length

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 of the specimen."""
        return (-self.length / 2, 0.0, self.length / 2, self.depth)

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) are material; (n,) bool."""
        x, y = points[:, 0], points[:, 1]
        inside = (np.abs(x) <= self.length / 2) & (y >= 0) & (y <= self.depth)
        return inside & ~_in_notch(self, points)

    def contacts(self) -> dict[str, tuple[float, float]]:
        """The three rollers."""
        return {"platen": (0.0, self.depth), "left": (-self.span / 2, 0.0), "right": (self.span / 2, 0.0)}

    def grip_regions(self, radius: float) -> tuple[GripRegion, ...]:
        """Rollers free to turn: platen pushed down, supports held up, x held at the platen."""
        outer = max(self.contact, 2.5 * radius)
        disk = {"inner": 0.0, "outer": outer, "axis": 0.0, "half_angle": np.pi}
        spots = self.contacts()
        rows = (
            ("platen", spots["platen"], (0.0, -1.0), 1.0, "drive"),
            ("left", spots["left"], (0.0, 1.0), 0.0, "react"),
            ("right", spots["right"], (0.0, 1.0), 0.0, "react"),
            ("centre", spots["platen"], (1.0, 0.0), 0.0, "guide"),
        )
        return tuple(
            GripRegion(name=n, centre=c, direction=d, drive=s, role=r, anchor_x=c[0], **disk) for n, c, d, s, r in rows
        )

    def protected(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) are so near a roller that bonds take no damage; (n,) bool."""
        near = [np.hypot(*(points - c).T) <= self.guard for c in self.contacts().values()]
        return np.any(near, axis=0)

    def outline(self) -> list[np.ndarray]:
        """Closed polygons (k, 2) of the boundary, for pictures."""
        x0, y0, x1, y1 = self.bounds
        box = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
        return [box, _notch_outline(self)]


@dataclass(frozen=True)
class DiskCompactTension:
    """DC(T) after ASTM D7313: a notched disk with a flat mouth, pulled by two pins; lengths in m."""

    diameter: float
    width: float
    edge_to_load_line: float
    thickness: float
    notch_length: float
    notch_width: float = 0.0
    pin_diameter: float = 25 * MM
    pin_spacing: float = 50 * MM
    gauge_length: float = 4 * MM
    gauge_y: float = 0.0

    geometry: ClassVar[str] = "dct"
    arc: ClassVar[float] = np.pi / 6  # the pin's force is spread over ± this angle of its hole
    rim: ClassVar[float] = 1 * MM  # depth of the loaded rim
    guard: ClassVar[float] = 6 * MM  # no damage within this distance of the holes

    def __post_init__(self) -> None:
        checks = _common_checks(self)
        total = self.edge_to_load_line + self.width
        checks += [
            (
                self.notch_length >= self.width,
                f"notch_length_mm = {self.notch_length / MM:g} reaches outside the specimen: it must be smaller "
                f"than width_mm = {self.width / MM:g}",
            ),
            (
                total > self.diameter,
                f"edge_to_load_line_mm + width_mm = {total / MM:g} must not exceed diameter_mm = "
                f"{self.diameter / MM:g}",
            ),
            (
                self.pin_spacing <= self.pin_diameter,
                f"pin_spacing_mm = {self.pin_spacing / MM:g} must be larger than pin_diameter_mm = "
                f"{self.pin_diameter / MM:g}",
            ),
        ]
        _refuse(checks)
        rim = np.hypot(self.pin_spacing / 2, self.edge_to_load_line - self.centre_y) + self.pin_diameter / 2
        _refuse(
            [
                (
                    bool(rim >= self.diameter / 2 or self.edge_to_load_line <= self.pin_diameter / 2),
                    f"the pin holes (spacing {self.pin_spacing / MM:g} mm, diameter {self.pin_diameter / MM:g} mm, "
                    f"{self.edge_to_load_line / MM:g} mm from the mouth) reach outside the disk: move or shrink them",
                )
            ]
        )

    @property
    def centre_y(self) -> float:
        """y of the disk's centre (m)."""
        return self.edge_to_load_line + self.width - self.diameter / 2

    @property
    def tip(self) -> tuple[float, float]:
        return (0.0, self.edge_to_load_line + self.notch_length)

    @property
    def ligament_length(self) -> float:
        return self.width - self.notch_length

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 of the specimen."""
        return (-self.diameter / 2, 0.0, self.diameter / 2, self.edge_to_load_line + self.width)

    def holes(self) -> dict[str, tuple[float, float]]:
        """Centres of the pin holes."""
        half = self.pin_spacing / 2
        return {"left": (-half, self.edge_to_load_line), "right": (half, self.edge_to_load_line)}

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) are material; (n,) bool."""
        disk = np.hypot(points[:, 0], points[:, 1] - self.centre_y) <= self.diameter / 2
        holes = [np.hypot(*(points - c).T) < self.pin_diameter / 2 for c in self.holes().values()]
        return disk & (points[:, 1] >= 0) & ~np.any(holes, axis=0) & ~_in_notch(self, points)

    def grip_regions(self, radius: float) -> tuple[GripRegion, ...]:
        """Left pin held, right pin pulled along x; both free to turn, kept on the load line."""
        hole = self.pin_diameter / 2
        spots = self.holes()
        rim = {"inner": hole, "outer": hole + max(self.rim, 2.5 * radius), "half_angle": self.arc}
        rows = (
            ("right", np.pi * 0, (1.0, 0.0), 1.0, "drive"),
            ("left", np.pi, (-1.0, 0.0), 0.0, "react"),
            ("right", np.pi * 0, (0.0, 1.0), 0.0, "guide"),
            ("left", np.pi, (0.0, 1.0), 0.0, "guide"),
        )
        return tuple(
            GripRegion(
                name=n if r != "guide" else f"{n}_line", centre=spots[n], axis=a, direction=d, drive=s, role=r, **rim
            )
            for n, a, d, s, r in rows
        )

    def protected(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) are so near a pin that bonds take no damage; (n,) bool."""
        near = [np.hypot(*(points - c).T) <= self.pin_diameter / 2 + self.guard for c in self.holes().values()]
        return np.any(near, axis=0)

    def outline(self) -> list[np.ndarray]:
        """Closed polygons (k, 2) of the boundary, for pictures."""
        turn = np.linspace(0, 2 * np.pi, 361)
        circle = np.column_stack([np.sin(turn), np.cos(turn)])
        disk = circle * self.diameter / 2 + (0, self.centre_y)
        disk[:, 1] = np.maximum(disk[:, 1], 0)
        holes = [circle * self.pin_diameter / 2 + c for c in self.holes().values()]
        return [disk, *holes, _notch_outline(self)]


def _notch_outline(specimen: Specimen) -> np.ndarray:
    """The notch as an open polygon from mouth to mouth around its tip."""
    half, (_, top) = specimen.notch_width / 2, specimen.tip
    turn = np.linspace(np.pi, 0, 19)
    end = np.column_stack([half * np.cos(turn), top - half + half * np.sin(turn)])
    return np.vstack([(-half, 0), end, (half, 0)])

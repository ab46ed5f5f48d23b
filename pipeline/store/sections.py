"""The tables of experiment.toml; a description is the comment of its key, a property its value in SI."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from pipeline.core.problem import Kinematics
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam, Specimen
from pipeline.core.units import GPA, MINUTE, MM, MPA
from pipeline.materials.elastic import Plane
from pipeline.microstructure.placement import ImagePlacement
from pipeline.store.quantities import (
    Angle,
    BondOpening,
    Box,
    Celsius,
    Count,
    Energy,
    Gap,
    Gigapascal,
    Newton,
    Opening,
    OpeningRate,
    Pair,
    Pitch,
    Places,
    Poisson,
    Radius,
    Ratio,
    Scatter,
    Size,
    Strength,
    Subset,
)


class Section(BaseModel):
    """One table: frozen, unknown keys refused, no silent conversion of types, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class PixelFrame(Section):
    """How pixels lie on the specimen."""

    mm_per_px: Pitch = Field(examples=[0.05], description="edge of one pixel on the specimen")
    origin_px: Pair = Field(
        examples=[[1500.0, 1200.0]], description="column, row of the specimen origin; may lie outside the image"
    )
    rotation_deg: Angle = Field(default=0.0, description="turns image axes into specimen axes, counter-clockwise")
    mirror: bool = Field(default=False, description="true: the other face was photographed")

    def placement(self) -> ImagePlacement:
        """The map between pixels and specimen coordinates; turned first, then mirrored in x."""
        return ImagePlacement(self.mm_per_px * MM, self.origin_px, self.rotation_deg, self.mirror)


class SpecimenSection(Section):
    """What both geometries share."""

    kind: ClassVar[type[SingleEdgeNotchedBeam] | type[DiskCompactTension]]

    geometry: str
    thickness_mm: Size = Field(examples=[40.0], description="out of plane")
    image: PixelFrame | None = Field(default=None, description="for specimen.png|tif and labels.png")

    def specimen(self) -> Specimen:
        """The specimen in metres; core.specimen refuses what cannot be cut."""
        return self.kind(**{k.removesuffix("_mm"): v * MM for k, v in self if k.endswith("_mm")})


class SebSection(SpecimenSection):
    """Single-edge notched beam."""

    kind = SingleEdgeNotchedBeam

    geometry: Literal["seb"] = Field(description="single-edge notched beam in three-point bending")
    depth_mm: Size = Field(examples=[60.0], description="height of the beam, notch included")
    span_mm: Size = Field(examples=[130.0], description="distance of the supports")
    length_mm: Size = Field(examples=[137.0], description="whole length of the beam")
    notch_length_mm: Size = Field(examples=[15.0], description="mouth to tip")
    notch_width_mm: Gap = Field(default=0.0, description="0: a cut of zero width")
    gauge_length_mm: Size = Field(default=4.0, description="distance of the two CMOD gauge points across the mouth")
    gauge_y_mm: float = Field(default=0.0, description="negative: knife edges outside the specimen")


class DctSection(SpecimenSection):
    """Disk-shaped compact tension specimen, sizes of ASTM D7313."""

    kind = DiskCompactTension

    geometry: Literal["dct"] = Field(description="disk-shaped compact tension, ASTM D7313")
    diameter_mm: Size = Field(default=150.0, description="of the disk")
    width_mm: Size = Field(default=110.0, description="load line to back")
    edge_to_load_line_mm: Size = Field(default=35.0, description="flat mouth to load line")
    notch_length_mm: Size = Field(default=27.5, description="load line to tip")
    notch_width_mm: Gap = Field(default=0.0, description="0: a cut of zero width")
    pin_diameter_mm: Size = Field(default=25.0, description="of the holes")
    pin_spacing_mm: Size = Field(default=50.0, description="between the centres of the holes")
    gauge_length_mm: Size = Field(default=4.0, description="distance of the two CMOD gauge points across the mouth")
    gauge_y_mm: float = Field(default=0.0, description="negative: knife edges outside the specimen")


KINDS: dict[str, type[SpecimenSection]] = {"seb": SebSection, "dct": DctSection}


class LoadingSection(Section):
    """How the real test was driven."""

    cmod_rate_mm_per_min: OpeningRate = Field(examples=[0.5], description="of the real test")
    temperature_c: Celsius | None = Field(default=None, examples=[-12.0], description="of the real test")
    cmod_max_mm: Opening | None = Field(
        default=None, examples=[0.55], description="end of the simulated test; default: last station + 10 %"
    )

    @property
    def cmod_rate(self) -> float:
        """m/s"""
        return self.cmod_rate_mm_per_min * MM / MINUTE

    @property
    def cmod_max(self) -> float | None:
        """m"""
        return None if self.cmod_max_mm is None else self.cmod_max_mm * MM


class DicSection(Section):
    """Settings of image correlation."""

    subset_size_px: Subset = Field(default=25, description="edge of a subset")
    grid_step_px: Count = Field(default=6, description="distance of subset centres")
    roi_px: Box | None = Field(default=None, examples=[[0, 0, 1300, 1000]], description="column, row, width, height")
    sync_offset_s: float | None = Field(
        default=None, examples=[0.0], description="frames late against the load record; given: not estimated"
    )


class NoiseSection(Section):
    """Standard deviations of the measurement, where known."""

    displacement_std_mm: Scatter | None = Field(
        default=None, examples=[0.0002], description="of one displacement component"
    )
    load_std_n: Newton | None = Field(default=None, examples=[5.0], description="of one reading of the load")

    @property
    def displacement_std(self) -> float | None:
        """m"""
        return None if self.displacement_std_mm is None else self.displacement_std_mm * MM

    @property
    def load_std(self) -> float | None:
        """N"""
        return self.load_std_n


class MaterialSection(Section):
    """Elastic constants, ratios between the phases, measured strength."""

    mastic_modulus_gpa: Gigapascal | None = Field(default=None, examples=[10.0], description="or creep.csv")
    aggregate_modulus_gpa: Gigapascal | None = Field(
        default=None, examples=[50.0], description="not needed without aggregate"
    )
    poissons_ratio: Poisson = Field(default=0.25, description="at most 1/4 in plane strain, 1/3 in plane stress")
    plane: Literal["strain", "stress"] = "strain"
    interface_strength_ratio: Ratio = Field(default=0.95, description="of the mastic's current f_max")
    interface_opening_ratio: Ratio = Field(default=0.30, description="of the mastic's current delta_max")
    aggregate_strength_ratio: Ratio = Field(
        default=3.0, description="of [start].f_max_n: stays while the mastic varies ..."
    )
    aggregate_opening_ratio: Ratio = Field(default=1.0, description="of [start].delta_max_m")
    aggregate_follows: bool = Field(default=False, description="... unless true: then of the mastic's current values")
    shear_strength_ratio: Ratio = Field(default=1.0, description="tangential to normal")
    shear_opening_ratio: Ratio = Field(default=1.0, description="tangential to normal")
    softening: Literal["linear", "exponential", "bilinear-tail"] = "linear"
    unloading: Literal["secant", "elastic"] = "secant"
    tensile_strength_mpa: Strength | None = Field(
        default=None, examples=[4.0], description="measured; with the next one gives the start"
    )
    fracture_energy_j_per_m2: Energy | None = Field(default=None, examples=[230.0], description="measured")
    conversion: Literal["contact-area", "lattice"] = Field(
        default="contact-area", description="the paper's, times its 0.74; lattice: factor 1, use for concrete"
    )
    touching: Literal["interface", "aggregate"] = Field(
        default="interface", description="strength of bonds between two touching stones; aggregate: the paper"
    )

    @property
    def plane_state(self) -> Plane:
        """As the elastic laws name it."""
        return Plane(self.plane)

    @property
    def mastic_modulus(self) -> float | None:
        """Pa"""
        return None if self.mastic_modulus_gpa is None else self.mastic_modulus_gpa * GPA

    @property
    def aggregate_modulus(self) -> float | None:
        """Pa"""
        return None if self.aggregate_modulus_gpa is None else self.aggregate_modulus_gpa * GPA

    @property
    def tensile_strength(self) -> float | None:
        """Pa"""
        return None if self.tensile_strength_mpa is None else self.tensile_strength_mpa * MPA

    @property
    def fracture_energy(self) -> float | None:
        """J/m²"""
        return self.fracture_energy_j_per_m2


class ModelSection(Section):
    """The lattice."""

    particle_radius_mm: Radius = Field(default=0.3, description="half the spacing of particles")
    kinematics: Literal["small", "finite"] = "small"
    lattice_angle_deg: Angle = Field(default=90.0, description="direction of close-packed rows against x")

    @property
    def radius(self) -> float:
        """m"""
        return self.particle_radius_mm * MM

    @property
    def lattice_angle(self) -> float:
        """rad"""
        return float(np.deg2rad(self.lattice_angle_deg))

    @property
    def motion(self) -> Kinematics:
        """As the engines name it."""
        return Kinematics(self.kinematics)


class StartSection(Section):
    """Centre of the parameter grid."""

    f_max_n: Newton = Field(examples=[71.0], description="per bond of the lattice of particle_radius_mm, thickness_mm")
    delta_max_m: BondOpening = Field(examples=[1.14e-4], description="opening at which a bond has failed")


class ObservationSection(Section):
    """Where and when displacements are compared."""

    columns_mm: Places = Field(default=(-9.0, -4.5, 4.5, 9.0), description="x, from the notch line")
    rows_mm: Places = Field(default=(0.0, 1.5, 3.0, 4.5), description="ahead of the notch tip")
    cmod_count: Count = Field(default=10, description="stations")
    cmod_step_mm: Opening = Field(default=0.05, description="from the peak on")

    @property
    def cmod_step(self) -> float:
        """m"""
        return self.cmod_step_mm * MM

    def points(self, specimen: Specimen) -> np.ndarray:
        """Observation points (rows · columns, 2) in m, row by row from the notch tip on."""
        x, y = np.meshgrid(self.columns_mm, self.rows_mm)
        return np.column_stack([x.ravel(), y.ravel()]) * MM + specimen.tip

"""A batch of specimens of engine B, of one geometry and radius, on which the diagnosis learns or is tried.

No two materials are put together alike, and two models of one kind differ less than a model and a material. So the
networks of a batch are of several kinds: finer and coarser than the lattice, with bonds that carry shear and without.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

from pipeline.core.units import MM
from pipeline.execution.progress import Progress, Silent
from pipeline.gap.library import Entry, nearest
from pipeline.store.atomic import write_atomically
from pipeline.store.creep import FILE, encode_creep
from pipeline.store.new import first_experiment
from pipeline.store.results import prepare_output
from pipeline.study.truth import made_already
from pipeline.study.typical_creep import creep_record
from pipeline.study.virtual_test import virtual_test

KINDS = tuple(product((1.5, 1.9, 2.4), (None, 0.1)))  # pitch in radii; Poisson's ratio if not the lattice's
CENTRAL = frozenset({"creep", "rate_law_per_decade"})  # effects for which there is no law of bonds that slide


@dataclass(frozen=True)
class Batch:
    """Where the specimens lie, one a seed, and what they are.

    Parameters
    ----------
    out : folder of tests and simulations; a run that was stopped goes on in it
    geometry : str
    radius_mm : float
    progress : who is told
    creep : file with the creep compliance of the mastic, or None; every test gets it as its creep test
    """

    out: Path
    geometry: str = "seb"
    radius_mm: float = 1.0
    progress: Progress = field(default_factory=Silent)
    creep: Path | None = None

    def folder(self, seed: int) -> Path:
        """The folder of a specimen."""
        return self.out / f"{self.geometry}-{self.radius_mm:g}-{seed:04d}"

    def slides(self, seed: int) -> bool:
        """Whether the bonds of a specimen carry shear."""
        return KINDS[seed % len(KINDS)][1] is not None

    def entry(self, entries: list[Entry]) -> Entry:
        """The entry of a library to judge the specimens by."""
        return nearest(entries, self.geometry, self.radius_mm * MM)

    def with_creep(self) -> Batch:
        """The same with a creep test of the mastic, of the modulus that virtual tests have."""
        sheet = prepare_output(self.out) / FILE
        write_atomically(sheet, encode_creep(creep_record(first_experiment(self.geometry, "batch"))))
        return replace(self, creep=sheet)

    def make(self, bundle: Path, seed: int, effects: Mapping[str, float] | None = None) -> None:
        """Make a virtual test with effects, if it was not made before."""
        if not made_already(bundle):
            of_all = {"creep": 0.0} if self.creep else {}
            acting = of_all | dict(effects or {})
            pitch, ratio = KINDS[seed % len(KINDS)]
            virtual_test(
                bundle,
                seed=seed,
                geometry=self.geometry,
                radius_mm=self.radius_mm,
                creep=self.creep,
                effect=sorted(acting.items()),
                pitch=pitch,
                poissons_ratio=None if any(acting.get(name) for name in CENTRAL) else ratio,
            )

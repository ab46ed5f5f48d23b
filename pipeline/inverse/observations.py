"""What was measured and what was simulated, at the same CMOD stations and points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.inverse.design import Design


@dataclass(frozen=True)
class Measured:
    """A measured test at its CMOD stations.

    Parameters
    ----------
    cmod : (s,) array, m; stations
    field : DisplacementField with the stations as frames and p points, or None
    load : (s,) array, N, NaN where missing, or None
    load_std : (s,) array, N; of the noise in `load`; asked for where `load` is given
    """

    cmod: np.ndarray
    field: DisplacementField | None = None
    load: np.ndarray | None = None
    load_std: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.field is not None and len(self.field.abscissa) != len(self.cmod):
            raise InputError(
                f"the measured field has {len(self.field.abscissa)} frames, but there are {len(self.cmod)} stations: "
                "bring it to the stations first"
            )
        if self.load is not None and (self.load_std is None or not (np.asarray(self.load_std) > 0).all()):
            raise InputError("a measured load needs a positive standard deviation (load_std_n) to be weighed with")


@dataclass(frozen=True)
class Simulated:
    """What every simulation of the grid gave at the same stations and points.

    Parameters
    ----------
    displacement : (n_f, n_d, s, p, 2) array, m, NaN where a point could not be observed, or None
    load : (n_f, n_d, s) array, N, NaN where a station was not reached, or None
    """

    displacement: np.ndarray | None = None
    load: np.ndarray | None = None

    @staticmethod
    def of(
        design: Design, displacement: Sequence[np.ndarray] | None = None, load: Sequence[np.ndarray] | None = None
    ) -> Simulated:
        """From one (s, p, 2) and one (s,) array a node, in the order of `design.nodes()`."""
        return Simulated(
            *(
                None if a is None else np.reshape(np.stack(a), design.shape + np.shape(a[0]))
                for a in (displacement, load)
            )
        )

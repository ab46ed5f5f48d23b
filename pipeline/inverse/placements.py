"""The same test on the same lattice laid elsewhere: what the placement of particles against stones does."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.inverse.flanks import changed_flank
from pipeline.inverse.objective import Comparison
from pipeline.inverse.observations import Measured, Simulated


@dataclass(frozen=True)
class Placements:
    """Simulations at one pair of parameters, the first on the lattice of the grid.

    Parameters
    ----------
    displacement : (k, s, p, 2) array, m, NaN where a point could not be observed, or None
    load : (k, s) array, N, NaN where a station was not reached, or None
    """

    displacement: np.ndarray | None
    load: np.ndarray | None

    @property
    def count(self) -> int:
        """Placements, that of the grid among them."""
        return len(self.load if self.displacement is None else self.displacement)  # type: ignore[arg-type]

    def comparable(self, measured: Measured) -> Placements:
        """The same, without what lies on the other side of the crack than in the measurement."""
        if self.displacement is None or measured.field is None:
            return self
        field = measured.field
        other = changed_flank(field.points, field.displacement, field.std, self.displacement)
        return replace(self, displacement=np.where(other[..., None], np.nan, self.displacement))

    def averaged(self, simulated: Simulated) -> Simulated:
        """Every node moved by what the mean of all placements differs from the grid's own."""
        return Simulated(
            *(
                None if values is None or placed is None else values + (placed - placed[0]).mean(axis=0)
                for values, placed in ((simulated.displacement, self.displacement), (simulated.load, self.load))
            )
        )

    def deviations(self, comparison: Comparison) -> np.ndarray:
        """Features of each placement minus their mean; (k, N)."""
        features = comparison.features(self.displacement, self.load)
        return features - features.mean(axis=0)

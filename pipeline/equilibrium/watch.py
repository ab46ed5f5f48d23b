"""When the far bonds must be looked at again, and which will soon be damaged."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

LIKELY = 0.95  # of δ_peak: when further bonds must become active, far ones opened beyond this do too
SOON = 0.99  # of δ_peak: bonds expected beyond this in the next increment become active before it
RARELY = 4  # increments between two looks at most


@dataclass
class Watch:
    """How near (m,) the far bonds are to δ_peak, and how fast they approach it.

    A look costs a solution of the far field, as much as ten iterations; between two looks its bonds are
    expected to open on as they did before. Where one was damaged all the same, the increments since the
    last look are done again.
    """

    interval: int = 1
    _seen: np.ndarray | None = field(default=None, repr=False)

    def damaged(self, usage: np.ndarray) -> np.ndarray:
        """Far bonds (m,) bool that must become active, if any opened beyond its δ_peak."""
        return usage > LIKELY if np.any(usage > 1) else np.zeros(usage.size, bool)

    def expected(self, usage: np.ndarray, increments: int) -> np.ndarray:
        """Takes in usages (m,) that were found harmless, so many increments after the last ones.

        Returns the bonds (m,) bool that the next increment is expected to damage.
        """
        rate = np.zeros(usage.size) if self._seen is None else (usage - self._seen) / increments
        self._seen = usage
        growing = (rate > 0) & (usage > 0)
        soon = growing & (usage + rate > SOON)
        left = (SOON - usage[growing & ~soon]) / rate[growing & ~soon]
        self.interval = int(np.clip(left.min(initial=RARELY), 1, RARELY))
        return soon

    def restart(self) -> None:
        """After increments that must be done again: look at the next one."""
        self.interval = 1

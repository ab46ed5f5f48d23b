"""What residuals of a fit tell about its uncertainty when neighbours go together."""

from __future__ import annotations

import numpy as np

MOST = 20.0  # of the inflation: beyond it the fit is wrong, not uncertain


def inflation(residual: np.ndarray, group: np.ndarray | None = None) -> float:
    """(1 + ρ)/(1 − ρ): how much larger variances are than with independent residuals; at least 1.

    ρ is the correlation of neighbours (first-order autoregression). A smooth law that does not quite fit
    leaves residuals in waves; each wave counts about once, not as often as it was read. The fit takes its own
    part out of the residuals, so ρ is raised by 1/n, its bias under independence.

    Parameters
    ----------
    residual : (n,) array, in the order in which neighbours may go together
    group : (n,) array; readings of the same value (replicates at one time) are averaged first; None: each alone
    """
    if group is not None:
        _, place, count = np.unique(group, return_inverse=True, return_counts=True)
        residual = np.bincount(place, residual) / np.sqrt(count)
    power = float(residual @ residual)
    if residual.size < 3 or power == 0:
        return 1.0
    rho = float(residual[1:] @ residual[:-1]) / power + 1 / residual.size
    return float(np.clip((1 + rho) / max(1 - rho, 1e-9), 1.0, MOST))

"""What became of each point, as a code and as a sentence."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """0 and 1 carry a result; everything above is a failure with its reason."""

    OK = 0
    SPLIT = 1
    NOT_REACHED = 10
    NOT_CONVERGED = 11
    OUTSIDE = 12
    NO_CONTRAST = 13
    POOR_MATCH = 14
    TWO_CRACKS = 15
    ON_CRACK = 16
    OUTLIER = 17
    SATURATED = 18

    @property
    def failed(self) -> bool:
        return self > Status.SPLIT

    @property
    def sentence(self) -> str:
        return _SENTENCES[self]


_SENTENCES = {
    Status.OK: "ok: one affine warp explains the subset",
    Status.SPLIT: "split: a line parts the subset, the displacement is that of the part holding the centre",
    Status.NOT_REACHED: "failed: no neighbour had a result to start from",
    Status.NOT_CONVERGED: "failed: the iterations did not settle",
    Status.OUTSIDE: "failed: the subset leaves the picture",
    Status.NO_CONTRAST: "failed: too little contrast for the accuracy asked for",
    Status.POOR_MATCH: "failed: neither one warp nor two explain the grey values",
    Status.TWO_CRACKS: "failed: more than one crack in the subset",
    Status.ON_CRACK: "failed: the centre lies on the crack, its side cannot be told",
    Status.OUTLIER: "failed: contradicts the neighbours on its own side",
    Status.SATURATED: "failed: less than half of the subset is not saturated",
}

"""What a long run tells while it goes on; the face decides how to show it."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Told by the main thread, in the order in which things happen."""

    def stage(self, name: str) -> None:
        """The next stage of a command begins; `name` is a few words."""

    def begin(self, total: int, kept: int, what: str = "simulation") -> None:
        """`total` of something are wanted, `kept` of them lie in the store already; `what` is one of them."""

    def done(self, key: str) -> None:
        """The one called `key` lies in the store."""

    def lost(self, key: str, error: BaseException) -> None:
        """The process of `key` was lost; its simulation is tried once more."""

    def failed(self, key: str, error: BaseException) -> None:
        """The simulation `key` failed for good; the others go on."""


class Silent:
    """A progress nobody looks at."""

    def stage(self, name: str) -> None:
        """Say nothing."""

    def begin(self, total: int, kept: int, what: str = "simulation") -> None:
        """Say nothing."""

    def done(self, key: str) -> None:
        """Say nothing."""

    def lost(self, key: str, error: BaseException) -> None:
        """Say nothing."""

    def failed(self, key: str, error: BaseException) -> None:
        """Say nothing."""

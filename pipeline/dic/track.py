"""A series of pictures, followed in time; the reference is renewed when the match decays.

Every warp leads from frame 0: a renewed reference is sampled where the points have been carried, so that the same
material is matched and nothing is left to be composed afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.field import DisplacementField
from pipeline.dic.camera import View
from pipeline.dic.core import core
from pipeline.dic.correlate import matched
from pipeline.dic.correlation import Correlation
from pipeline.dic.grey import checked
from pipeline.dic.grid import Grid
from pipeline.dic.parting import Match
from pipeline.dic.settings import Settings

_LOST = 0.05  # share of the points that may fail before the reference is renewed


@dataclass(frozen=True, eq=False)
class _Base:
    """A reference: the picture, and how the points came there (None: it is frame 0)."""

    image: np.ndarray
    picture: Any
    carried: Correlation | None

    def match(self, current: Any, grid: Grid, settings: Settings) -> Match:
        if self.carried is None:
            return Match(core(), self.picture, current, grid, settings)
        c = self.carried
        lost = np.where(c.valid[:, None], c.warp, np.nan)
        both = c.split & np.isfinite(c.far[:, 0])
        line = np.where(both[:, None], c.line, [0.0, -1.0])
        far = np.where(both[:, None], c.far, lost)
        return Match(core(), self.picture, current, grid, settings, lost, far, line)


class Tracker:
    """A series that is followed frame by frame, and can be taken up again after any frame.

    Parameters
    ----------
    first : (rows, columns) array; the unloaded picture, frame 0
    settings : Settings; `search_px` is against the frame before
    renew_znssd : median ZNSSD of the sound points above which the frame before becomes the reference

    Attributes
    ----------
    number : int; the last frame that was followed
    base : int; the frame that is the reference
    sound : float; largest share of sound points since the reference was renewed
    """

    def __init__(self, first: np.ndarray, settings: Settings | None = None, *, renew_znssd: float = 0.25) -> None:
        self.settings = settings or Settings()
        self.renew_znssd = renew_znssd
        self.number = self.base = 0
        self.sound = 0.0
        self._first = checked(first, "frame 0")
        self._shape = self._first.shape
        self.grid = Grid.over((self._shape[0], self._shape[1]), self.settings)
        self._base = _Base(self._first, core().Picture(self._first), None)
        self._before: tuple[np.ndarray, Any, Correlation] | None = None
        self._earlier: Correlation | None = None

    def resume(
        self,
        number: int,
        last: tuple[np.ndarray, Correlation],
        earlier: Correlation | None,
        base: tuple[int, np.ndarray, Correlation] | None,
        sound: float,
    ) -> None:
        """Go on after frame `number` as if it had just been followed.

        Parameters
        ----------
        number : int
        last : picture and result of that frame
        earlier : result of the frame before it, None where that is frame 0
        base : number, picture and result of the reference, None for frame 0
        sound : float; `sound` after that frame
        """
        self.number, self.sound, self._earlier = number, sound, earlier
        grey = checked(last[0], f"frame {number}", like=self._first)
        picture = core().Picture(grey)
        self._before = (grey, picture, last[1])
        if base is not None:
            self.base = base[0]
            image = grey if base[0] == number else checked(base[1], f"frame {base[0]}", like=self._first)
            self._base = _Base(image, core().Picture(image), base[2])

    def keep(self, result: Correlation) -> None:
        """Go on from the last result in another form, as it was rounded for a file, say: a series that is taken up
        again from such files is then the same to the last bit."""
        assert self._before is not None, "nothing was followed yet"
        self._before = (*self._before[:2], result)

    def follow(self, frame: np.ndarray) -> Correlation:
        """The next frame against frame 0.

        Raises
        ------
        InputError
            for a picture that cannot be used, naming the frame
        ConvergenceError
            where nothing is found again
        """
        number = self.number + 1
        grey = checked(frame, f"frame {number}", like=self._first)
        picture = core().Picture(grey)
        start = _ahead(self._before[2], self._earlier) if self._before else None
        result, renewed = self._found(picture, grey, start, number)
        if result is None:
            remark = picture.range.remark(grey)
            raise ConvergenceError(
                f"frame {number}{remark}: the speckle of the frame before is not found again; if the picture shows "
                "something else, leave it out, with its row in frames.csv"
            )
        self.sound = max(0.0 if renewed else self.sound, _share(result, self._shape))
        self._earlier = self._before[2] if self._before else None
        self._before, self.number = (grey, picture, result), number
        return result

    def _found(
        self, picture: Any, grey: np.ndarray, start: Correlation | None, number: int
    ) -> tuple[Correlation | None, bool]:
        """The match with the reference, or with the frame before where that has decayed; whether it was renewed."""
        result = _against(self._base, picture, grey, self.grid, self.settings, start, number)
        if self._before is None or self.base == self.number:
            return result, False
        if not _decayed(result, self._shape, self.sound, self.renew_znssd):
            return result, False
        self._base, self.base = _Base(*self._before), self.number
        again = _against(self._base, picture, grey, self.grid, self.settings, start, number)
        keep = result is not None and again is not None and again.valid.sum() < result.valid.sum()
        return (result if keep else again if again is not None else result), True


def track(
    frames: Iterable[np.ndarray], settings: Settings | None = None, *, renew_znssd: float = 0.25
) -> Iterator[Correlation]:
    """Follow the points of the first frame through the others.

    Parameters
    ----------
    frames : pictures of one size, the first unloaded; read one at a time, at most four are in memory
    settings, renew_znssd : as of `Tracker`

    Yields
    ------
    One Correlation a frame after the first; displacements are from frame 0, and the standard deviations of renewed
    references add up in squares.

    Raises
    ------
    InputError
        for pictures that cannot be used, naming the frame
    ConvergenceError
        where nothing is found again
    """
    series = iter(frames)
    tracker = Tracker(next(series), settings, renew_znssd=renew_znssd)
    for frame in series:
        yield tracker.follow(frame)


def _ahead(last: Correlation, earlier: Correlation | None) -> Correlation:
    """The last result moved on by the step that most points made before; from rest where there is none."""
    moved = last.warp[:, :2] - (earlier.warp[:, :2] if earlier else 0.0)
    both = last.valid & earlier.valid if earlier else last.valid
    if not both.any():
        return last
    step = np.zeros(6)
    step[:2] = np.median(moved[both], axis=0)
    return replace(last, warp=last.warp + step)


def _against(
    base: _Base,
    picture: Any,
    grey: np.ndarray,
    grid: Grid,
    settings: Settings,
    start: Correlation | None,
    number: int,
) -> Correlation | None:
    """Match one frame; None where nothing is found again."""
    try:
        result = matched(base.match(picture, grid, settings), base.image, grey, start)
    except ConvergenceError as error:
        if start is None:
            raise ConvergenceError(f"frame {number}: {error}") from error
        return None
    return result if base.carried is None else replace(result, std=np.hypot(result.std, base.carried.std))


def _decayed(result: Correlation | None, shape: tuple[int, ...], sound: float, renew_znssd: float) -> bool:
    if result is None or not result.valid.any():
        return True
    return bool(np.median(result.znssd[result.valid]) > renew_znssd or _share(result, shape) < sound - _LOST)


def _share(result: Correlation, shape: tuple[int, ...]) -> float:
    """Share of sound points among those that have not left the picture."""
    now = result.points + np.nan_to_num(result.warp[:, :2])
    margin = 1.5 * (result.points.min() if result.points.size else 0)
    inside = np.all((now > margin) & (now < np.array(shape[::-1]) - 1 - margin), axis=1)
    return float(result.valid[inside].mean()) if inside.any() else 0.0


def tracked_field(
    frames: Iterable[np.ndarray], time: np.ndarray, view: View, settings: Settings | None = None
) -> DisplacementField:
    """The displacements of a series in specimen coordinates, m; `time` (frames,) in s counts frame 0 too."""
    time = np.asarray(time, float)
    moved: list[np.ndarray] = []
    valid: list[np.ndarray] = []
    std: list[np.ndarray] = []
    points = np.zeros((0, 2))
    for result in track(frames, settings):
        points = result.points
        moved.append(view.vector(result.displacement))
        valid.append(result.valid)
        std.append(np.sqrt(np.mean(result.std**2, axis=1)) * view.metre_per_px)
    if len(moved) + 1 != time.size:
        raise InputError(f"{len(moved) + 1} frames but {time.size} times: give one time a frame")
    still = np.zeros(points.shape)
    return DisplacementField(
        points=view.point(points),
        displacement=np.array([still, *moved]),
        valid=np.array([np.ones(len(points), bool), *valid]),
        std=np.array([np.zeros(len(points)), *std]),
        abscissa=time,
    )

"""From a clip to the angle of the horn in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.video.clip import Clip
from servotwin.bench.video.corners import Finder
from servotwin.bench.video.instant import JUMP, LED, NONE, Instant, Lights, Region, jump
from servotwin.bench.video.marker import CASE, DICTIONARY, HORN
from servotwin.bench.video.plane import Plane, fit_plane, mapped
from servotwin.bench.video.shake import steadied
from servotwin.errors import InputError
from servotwin.look.opencv import load_opencv
from servotwin.units import is_finite

_FEWEST = 3  # pictures with the mark
_MISREAD = 8.0  # usual residuals: a picture that is not counted
_LEAST_MISREAD = 0.03  # of the mark's side (assumed): a rolling shutter bends a fast mark, and its angle is right
_MOVED = 0.01  # of the side, and half a pixel: a usual residual that no camera at rest leaves
_REACH = 1.5  # of the circle that the mark's corners are in: where no light is looked for
_SMALL = 30.0  # pixels, below which a blurred mark is missed (measured, see the guide)


@dataclass(frozen=True, kw_only=True, eq=False)
class Filmed:
    """The angle of a horn, picture by picture.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Of all pictures, from the common instant on [s]
    angle : ndarray, shape (n,)
        nan where the mark was not seen; positive counter-clockwise as the camera sees it, unless flipped [rad].
    angle_std : float
        Usual standard error of an angle [rad]
    instant : Instant
        Time 0, in the clip's own time.
    facts : mapping
        Of clip, mark and instant, in plain JSON, as a log's sidecar has them.
    remarks : tuple of str
        What the user should know.
    """

    time: NDArray[np.float64] = field(repr=False)
    angle: NDArray[np.float64] = field(repr=False)
    angle_std: float
    instant: Instant
    facts: Mapping[str, Any] = field(repr=False)
    remarks: tuple[str, ...] = ()

    @property
    def interval(self) -> float:
        """From picture to picture, usually [s]."""
        return float(np.median(np.diff(self.time)))


@dataclass
class _Seen:
    """What the pictures of a clip show."""

    time: list[float] = field(default_factory=list)
    horn: list[NDArray[np.float64]] = field(default_factory=list)
    case: list[NDArray[np.float64]] = field(default_factory=list)
    shape: tuple[int, ...] = ()


def read_clip(path: str | Path, *, mark: int = HORN, instant: str | float = JUMP, led: Region | None = None,
              flip: bool = False, zero: float | None = None, slow: float = 1.0) -> Filmed:
    """Return the angle of the mark in a clip.

    Angles count from where the mark's arrow points to the right in the picture, which is the same in all clips of a
    camera that is not touched; from that of a mark with id 1 on the case, if there is one; or as `zero` says. A fit has
    one offset for all its logs.

    The camera's tilt is found from all pictures at once, see `servotwin.bench.video.plane`; neither its focal length
    nor the size of the mark has to be known. A mark on the case is also what a camera that moves is told by.

    Parameters
    ----------
    path : str or Path
    mark : int
        Id of the mark on the horn.
    instant : {"jump", "led", "none"} or float
        Time 0: the first motion, a light that goes on, the first picture, or a time in the clip [s].
    led : tuple of int, optional
        Where the light is: left, top, width, height [pixels]; makes the instant that of the light.
    flip : bool
        Count clockwise as positive.
    zero : float, optional
        Angle in the first picture [rad].
    slow : float
        By how much the clip plays slower than what it shows: 8 for 240 pictures a second that play at 30.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    InputError
        If the clip cannot be read or is cut, shows no mark or two with the same id, or the instant is not in it.
    """
    if isinstance(instant, str) and instant not in (JUMP, LED, NONE):
        raise InputError("instant", got=instant, allowed=f"{LED}, {JUMP}, {NONE} or a time in the clip")
    clip = Clip(path, slow)
    lights = Lights(led) if led is not None or instant == LED else None
    seen, finder = _look(clip, mark, lights)
    time, horn, case = np.array(seen.time), np.array(seen.horn), np.array(seen.case)
    there = np.isfinite(horn).all(axis=(1, 2))
    if there.sum() < _FEWEST:
        others = ", ".join(str(one) for one in sorted(finder.seen) if one != mark)
        raise InputError(f"{path}: mark {mark} of {DICTIONARY}", got=f"seen in {there.sum()} of {len(time)} pictures"
                         + (f"; other marks: {others}" if others else ""), allowed=f"in {_FEWEST} or more: nearer, "
                         "sharper, with white paper all around it")
    steady, moved = steadied(horn, case)
    there &= np.isfinite(steady).all(axis=(1, 2))
    plane = fit_plane(steady[there])
    side = float(np.median(np.hypot(*np.moveaxis(np.diff(horn[there], axis=1), -1, 0))))
    good = plane.residual <= max(_MISREAD * float(np.median(plane.residual)), _LEAST_MISREAD * side)
    angle = np.full(len(time), np.nan)
    angle[np.flatnonzero(there)[good]] = np.unwrap(plane.angle[good])
    angle = (-1.0 if flip else 1.0) * _zeroed(angle, plane, case if np.isfinite(moved) else None, zero, flip=flip)
    error = float(np.median(plane.angle_std))
    found = _instant(instant, lights, time, angle, error, plane, horn[there])
    facts = {**_clip_facts(clip, seen, time, slow), **_mark_facts(plane, mark, side, angle, error, moved),
             "zero": "the first picture" if zero is not None else "the mark on the case" if np.isfinite(moved) else
             "the picture's horizontal",
             "turned": "clockwise" if flip else "counter-clockwise, as the camera sees it",
             "instant": {"kind": found.kind, "clip_time_s": found.time, "std_s": found.error}}
    return Filmed(time=time - found.time, angle=angle, angle_std=error, instant=found, facts=facts,
                  remarks=_remarks(time, angle, int((~good).sum()), side, plane, moved))


def _look(clip: Clip, mark: int, lights: Lights | None) -> tuple[_Seen, Finder]:
    """Return what all pictures show."""
    cv2 = load_opencv()
    wanted = (mark, CASE) if mark != CASE else (mark,)
    finder = Finder(wanted, str(clip.path))
    seen, nothing = _Seen(), np.full((4, 2), np.nan)
    for picture in clip.pictures():
        found = finder.corners(cv2.cvtColor(picture.colours, cv2.COLOR_BGR2GRAY))
        seen.time.append(picture.time)
        seen.horn.append(found.get(mark, nothing))
        seen.case.append(found.get(CASE, nothing) if mark != CASE else nothing)
        seen.shape = picture.colours.shape
        if lights is not None:
            lights.add(picture.colours)
    return seen, finder


def _zeroed(angle: NDArray[np.float64], plane: Plane, case: NDArray[np.float64] | None, zero: float | None, *,
            flip: bool) -> NDArray[np.float64]:
    """Return angles that count from what was asked for."""
    first = angle[np.flatnonzero(np.isfinite(angle))[0]]
    if zero is not None:
        return np.asarray(angle - first + (-zero if flip else zero))
    level = plane.level if case is None else float(plane.direction(np.nanmedian(case, axis=0)[None])[0])
    turns = 2.0 * np.pi * np.round((first - level) / (2.0 * np.pi))
    return np.asarray(angle - level - turns)


def _instant(asked: str | float, lights: Lights | None, time: NDArray[np.float64], angle: NDArray[np.float64],
             error: float, plane: Plane, horn: NDArray[np.float64]) -> Instant:
    if lights is not None:
        axis = mapped(plane.homography, np.zeros(2))
        return lights.instant(time, axis, _REACH * float(np.hypot(*np.moveaxis(horn - axis, -1, 0)).max()))
    if asked == JUMP:
        return jump(time, angle, error)
    if asked == NONE:
        return Instant(NONE, 0.0, 0.0)
    if not (is_finite(asked) and 0.0 <= asked <= time[-1]):
        raise InputError("instant", got=asked, allowed=f"a time in the clip, 0 to {time[-1]:.3f} s")
    return Instant("given", float(asked), 0.0)


def _clip_facts(clip: Clip, seen: _Seen, time: NDArray[np.float64], slow: float) -> dict[str, Any]:
    steps = np.diff(time)
    return {"file": clip.path.name, "codec": clip.codec, "width_px": seen.shape[1], "height_px": seen.shape[0],
            "pictures": len(time), "seconds": round(float(time[-1]), 6), "slow": slow,
            "pictures_per_s": round(float((len(time) - 1) / time[-1]), 4),
            "shortest_interval_s": round(float(steps.min()), 6), "longest_interval_s": round(float(steps.max()), 6)}


def _mark_facts(plane: Plane, mark: int, side: float, angle: NDArray[np.float64], error: float, moved: float,
                ) -> dict[str, Any]:
    # at the axis, a plane that is tilted by t looks shorter by cos t one way
    widths = np.linalg.svd(plane.local, compute_uv=False)
    return {"mark": mark, "dictionary": DICTIONARY, "side_px": round(side, 2),
            "tilt_deg": round(float(np.degrees(np.arccos(widths[1] / widths[0]))), 1),
            "seen": int(np.isfinite(angle).sum()), "corner_residual_px": round(float(np.median(plane.residual)), 4),
            "angle_std_deg": round(float(np.degrees(error)), 5),
            "case_seen": bool(np.isfinite(moved)), "camera_moved_px": round(moved, 3) if np.isfinite(moved) else None}


def _remarks(time: NDArray[np.float64], angle: NDArray[np.float64], misread: int, side: float, plane: Plane,
             moved: float) -> tuple[str, ...]:
    seen = np.flatnonzero(np.isfinite(angle))
    said = []
    if seen.size < angle.size:
        gap = float(np.diff(time[seen]).max(initial=0.0))
        said.append(f"the angle is missing in {angle.size - seen.size} of {angle.size} pictures (mark not seen"
                    + (f", or misread: {misread}" if misread else "") + f"), for {gap:.3f} s at most")
    if side < _SMALL:
        said.append(f"the mark is only {side:.0f} pixels wide: go nearer")
    if float(np.median(plane.residual)) > max(0.5, _MOVED * side):
        said.append(f"the corners do not turn about one axis, they are {np.median(plane.residual):.1f} pixels off: "
                    "does the camera move, or the mark wobble?")
    if np.isfinite(moved) and moved > 0.05 * side:
        said.append(f"the camera moved by {moved:.1f} pixels; the mark on the case was followed")
    return tuple(said)

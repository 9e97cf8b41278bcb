"""Windows of an episode that no numbers explain: contact, a hand, an object between the fingers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.rows import Mask, Noise

Array = NDArray[np.float64]
_OVER = 0.2  # s, whose mean residual counts
_BESIDE = 0.2  # s, left out before and after
_FAR, _LEAST = 12.0, math.radians(1.0)  # times the noise, and at least
_USUAL = 6.0  # times what residuals usually are
_MOST = 0.25  # of all samples


class LeftOut(NamedTuple):
    """A window that does not count: number and name of the episode, start and stop [s], and whose joint shows it."""

    number: int
    episode: str
    start: float
    stop: float
    joint: str

    def __str__(self) -> str:
        """Return a line."""
        return (f"left out: {self.start:.2f} to {self.stop:.2f} s of {self.episode}: {self.joint} does what neither "
                "servo nor arm explains, as where it touches something or a hand leads it")


def strange_windows(episodes: Sequence[Episode], residuals: Sequence[Array], used: Sequence[Mask], noise: Noise,
                    joints: Sequence[str]) -> tuple[LeftOut, ...]:
    """Return windows in which residuals are far beyond noise and what they are elsewhere; none where these are many."""
    found: list[LeftOut] = []
    size = 0.0
    for number, (episode, residual, mask) in enumerate(zip(episodes, residuals, used, strict=True)):
        few = max(round(_OVER / float(np.median(np.diff(episode.time)))), 1)
        kernel = np.ones(few) / few
        for j, joint in enumerate(joints):
            mean = np.abs(np.convolve(np.where(mask[:, j], residual[:, j], 0.0), kernel, mode="same"))
            usual = float(np.median(mean[mask[:, j]])) if mask[:, j].any() else 0.0
            strange = mean > max(_FAR * float(noise.positions[j]), _LEAST, _USUAL * usual)
            for a, b in _stretches(strange):
                start, stop = episode.time[a] - _BESIDE, episode.time[b] + _BESIDE
                found.append(LeftOut(number, episode.name, max(float(start), 0.0), float(stop), joint))
                size += float(stop - start)
    whole = sum(episode.motion.duration for episode in episodes)
    return tuple(found) if size < _MOST * whole * len(joints) else ()


def without(used: Sequence[Mask], episodes: Sequence[Episode], windows: Sequence[LeftOut],
            joints: Sequence[str]) -> list[Mask]:
    """Return which samples count where windows are left out: of the joint that shows it, and of those before it."""
    found = [mask.copy() for mask in used]
    for window in windows:
        time = episodes[window.number].time
        found[window.number][(time >= window.start) & (time <= window.stop), :joints.index(window.joint) + 1] = False
    return found


def _stretches(mask: Mask) -> list[tuple[int, int]]:
    """Return first and last index of each stretch."""
    ends = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return list(zip(ends[::2].tolist(), (ends[1::2] - 1).tolist(), strict=True))

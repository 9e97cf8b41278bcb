"""What sends the pulses: a frame clock whose rate may change, and frames that get lost."""

from __future__ import annotations

from typing import Any, NamedTuple

from servotwin.models.state.noise import uniform

_SAME = 1e-9  # of a frame: instants that are nearer are one


class Sender(NamedTuple):
    """A frame clock: of its frames `passed` have begun since `base`, and `number` in all."""

    rate: float  # of frames [Hz]
    lost: float  # share of the frames that are not sent
    seed: int  # of which these are
    base: float  # [s]
    passed: int
    number: int
    time: float  # that the bench has come to [s]


def next_edge(sender: Any) -> float:
    """Return when the next frame begins [s]."""
    edge: float = sender.base + sender.passed / sender.rate
    return edge


def snapped(sender: Any, time: float) -> float:
    """Return a time, or that of the edge right next to it: what is a billionth of a frame away is the edge [s]."""
    edge: float = sender.base + round((time - sender.base) * sender.rate) / sender.rate
    return edge if abs(time - edge) * sender.rate <= _SAME and edge >= next_edge(sender) else time


def tune(sender: Any, rate: float) -> None:
    """Take another rate [Hz] from the next edge on: the frame that has begun stays as it is."""
    sender.base, sender.passed, sender.rate = next_edge(sender), 0, rate


def is_lost(sender: Any) -> bool:
    """Tell whether the next frame gets lost; that is the same whatever came before."""
    if sender.lost == 0.0 or sender.lost == 1.0:
        return bool(sender.lost == 1.0)
    return bool(uniform(sender.seed, sender.number) < sender.lost)


def pass_edge(sender: Any) -> None:
    """Let the next frame begin."""
    sender.passed, sender.number = sender.passed + 1, sender.number + 1

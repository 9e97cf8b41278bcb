"""Bring the words of a call up to date, in compiled code."""

from __future__ import annotations

from servotwin.simulation.compile.addresses import numbers, words


def renew(at: int) -> int:
    """Put what has changed into words, and return 1.

    At the address stand how many words are copied, how many tell whether a float is not 0, and for each of these, the
    former first, the address of the word and that of its source.
    """
    copied, told = words(at, 2)[0], words(at, 2)[1]
    pairs = words(at + 16, 2 * (copied + told))
    for k in range(copied):
        words(pairs[2 * k], 1)[0] = words(pairs[2 * k + 1], 1)[0]
    for k in range(copied, copied + told):
        words(pairs[2 * k], 1)[0] = 1 if numbers(pairs[2 * k + 1], 1)[0] != 0.0 else 0
    return 1

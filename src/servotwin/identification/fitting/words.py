"""What logs cannot say, in words: which numbers only appear together, and what would tell them apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_VAGUE = 1.0  # standard error of a direction that is not determined: a factor e, or as much as is typical
_SHARE = 0.25  # what such a direction may add to the standard error of a number that counts as determined
_PART = 0.05  # of a direction
_GEAR = "gear.gear_reduction"  # what most products are with


@dataclass(frozen=True)
class Unidentifiable:
    """A direction in which the searched numbers may go without the logs noticing.

    Parameters
    ----------
    parameters : tuple of str
        That go together, none of which gets an interval.
    direction : tuple of float
        How far each of them goes; of logarithms where a number is searched by its logarithm.
    combinations : tuple of str
        What is determined nevertheless, such as ``"motor.torque_constant · gear.gear_reduction"``.
    remedies : tuple of str
        What would tell them apart.
    """

    parameters: tuple[str, ...]
    direction: tuple[float, ...]
    combinations: tuple[str, ...]
    remedies: tuple[str, ...] = ()

    def __str__(self) -> str:
        if len(self.parameters) == 1:
            text = f"{self.parameters[0]} is not determined by these logs"
        elif self.combinations:
            text = f"only {_and(self.combinations)} {'is' if len(self.combinations) == 1 else 'are'} determined, not " \
                   f"{_and(self.parameters)} each"
        else:
            text = f"{_and(self.parameters)} are not determined each: a change of one is made up for by the others"
        if not self.remedies:
            return text
        return f"{text}; {_or(self.remedies)} would {'tell' if len(self.parameters) == 1 else 'separate them'}"


def vague_directions(information: Array, inflation: float = 1.0, sizes: Array | None = None) -> tuple[Array, Array]:
    """Return which numbers are not determined by the data, and the directions that are not (columns of unit length).

    Parameters
    ----------
    information : ndarray, shape (p, p)
        Of the data alone, of scaled numbers.
    inflation : float
        Of standard errors, by correlated residuals.
    sizes : ndarray, shape (p,), optional
        What counts as the whole of a number; 1 unless given.

    Examples
    --------
    >>> flags, directions = vague_directions(np.array([[1e4, -1e4], [-1e4, 1e4]]))
    >>> flags.tolist(), directions.shape
    ([True, True], (2, 1))
    """
    whole = np.ones(len(information)) if sizes is None else sizes
    values, vectors = np.linalg.eigh(information * np.outer(whole, whole))
    floor = 1e-11 * max(float(values[-1]), 1e-300)
    std = inflation / np.sqrt(np.maximum(values, 1e-300))
    vague = (std > _VAGUE) | (values < floor)
    directions = vectors[:, vague]
    added = np.sqrt(((directions * np.minimum(std[vague], 1e6)) ** 2).sum(axis=1))
    moved = directions * whole[:, None]
    return added > _SHARE, moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)


def explain(names: Sequence[str], shares: Sequence[float], flags: Array,
            directions: Array) -> tuple[Unidentifiable, ...]:
    """Return the undetermined directions in words, the simplest ones first.

    Parameters
    ----------
    names : sequence of str
    shares : sequence of float
        By which share of its value a number changes with what is searched; nan where it may be 0. Only shares make
        products.
    flags, directions : ndarray
        Of `vague_directions`.
    """
    if not flags.any() or not directions.shape[1]:
        return ()
    found = []
    for v in _simple(directions).T:
        size = np.abs(v).max()
        which = [k for k in range(len(names)) if abs(v[k]) > _PART * size and flags[k]]
        if not which:
            continue
        combinations: tuple[str, ...] = ()
        if len(which) > 1 and all(math.isfinite(shares[k]) for k in which):
            combinations = _products([names[k] for k in which], [float(v[k]) * shares[k] for k in which])
        found.append(Unidentifiable(tuple(names[k] for k in which), tuple(float(v[k]) for k in which), combinations))
    return tuple(sorted(found, key=lambda item: (len(item.parameters), item.parameters)))


def _simple(directions: Array) -> Array:
    """Return directions that span the same space with few numbers in each: rows reduced one after the other."""
    basis = directions.T.copy()
    for row in range(len(basis)):
        pivot = row + int(np.argmax(np.abs(basis[row:]).max(axis=1)))
        basis[[row, pivot]] = basis[[pivot, row]]
        column = int(np.argmax(np.abs(basis[row])))
        basis[row] /= basis[row, column]
        for other in range(len(basis)):
            if other != row:
                basis[other] -= basis[other, column] * basis[row]
    return np.asarray(basis.T)


def _products(names: list[str], v: Sequence[float]) -> tuple[str, ...]:
    """Return products of powers that a direction leaves alone: each other number with the one that moves least."""
    pivot = names.index(_GEAR) if _GEAR in names else int(np.argmin(np.abs(v)))
    found = []
    for k, name in enumerate(names):
        if k == pivot:
            continue
        power = Fraction(-v[k] / v[pivot]).limit_denominator(4)
        if abs(float(power) + v[k] / v[pivot]) > 0.05:
            return ()
        found.append(f"{name}{' / ' if power < 0 else ' · '}{names[pivot]}{_power(abs(power))}")
    return tuple(found)


def _power(power: Fraction) -> str:
    if power == 1:
        return ""
    if power.denominator == 1:
        return "".join("⁰¹²³⁴⁵⁶⁷⁸⁹"[int(digit)] for digit in str(power.numerator))
    return f"^({power})"


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _or(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"

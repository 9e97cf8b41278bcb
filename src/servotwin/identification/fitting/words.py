"""What logs cannot say, in words: which numbers only appear together, and what would tell them apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_VAGUE = 1.0  # standard error of a direction that is not determined: a factor e, or as much as is typical
_SHARE = 0.25  # what such a direction may add to the standard error of a number that counts as determined
_PART = 0.05  # of a direction
_FAR = _SHARE / _PART  # e-folds that anything may go at most in a direction that is open: the bounds are nearer
_HIGHEST = 2  # power in a product that is put into words
_NEAR = 0.03  # to such a power
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


def vague_directions(information: Array, inflation: float = 1.0,
                     sizes: Array | None = None) -> tuple[NDArray[np.bool_], Array]:
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
    added = np.sqrt(((directions * np.minimum(std[vague], _FAR)) ** 2).sum(axis=1))
    moved = directions * whole[:, None]
    return added > _SHARE, moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)


def explain(names: Sequence[str], shares: Sequence[float], flags: NDArray[np.bool_],
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
    simple = simplest(directions)
    parts = np.abs(simple) / np.abs(simple).max(axis=0)
    members = (parts > _PART) & flags[:, None]
    for k in np.flatnonzero(flags & ~members.any(axis=1)):  # a little of several: none is left without words
        members[k, np.argmax(parts[k])] = True
    found = []
    for v, those in zip(simple.T, members.T, strict=True):
        which = np.flatnonzero(those).tolist()
        if not which:
            continue
        combinations: tuple[str, ...] = ()
        if len(which) > 1 and all(math.isfinite(shares[k]) for k in which):
            combinations = _products([names[k] for k in which], [float(v[k]) * shares[k] for k in which])
        found.append(Unidentifiable(tuple(names[k] for k in which), tuple(float(v[k]) for k in which), combinations))
    return tuple(sorted(found, key=lambda item: (len(item.parameters), item.parameters)))


def simplest(directions: Array) -> Array:
    """Return directions that span the same space with few numbers in each: rows reduced one after the other.

    Parameters
    ----------
    directions : ndarray, shape (p, q)

    Examples
    --------
    >>> simplest(np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]])).T.tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
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
    """Return products of small whole powers that a direction leaves alone; none where there are none such."""
    tried = [found for pivot in range(len(names)) if (found := _about(pivot, names, v)) is not None]
    # With the reduction where that will do, else with the smallest powers, else with what moves least
    order = sorted(tried, key=lambda f: (names[f.pivot] != _GEAR, f.powers, abs(v[f.pivot])))
    return order[0].texts if order else ()


class _Products(NamedTuple):
    """Products of each number with one of them, the sum of their powers, and which one that is."""

    texts: tuple[str, ...]
    powers: int
    pivot: int


def _about(pivot: int, names: list[str], v: Sequence[float]) -> _Products | None:
    """Return products of each other number with one; None where a power is no small whole number."""
    texts, powers = [], 0
    for k, name in enumerate(names):
        if k == pivot:
            continue
        exact = -v[k] / v[pivot]
        power = Fraction(exact).limit_denominator(_HIGHEST)
        if not 0 < abs(power.numerator) <= _HIGHEST or abs(float(power) - exact) > _NEAR:
            return None
        sign = " / " if power < 0 else " · "
        texts.append(f"{name}{_power(power.denominator)}{sign}{names[pivot]}{_power(abs(power.numerator))}")
        powers += power.denominator + abs(power.numerator)
    return _Products(tuple(texts), powers, pivot)


def _power(power: int) -> str:
    return "" if power == 1 else "⁰¹²³⁴⁵⁶⁷⁸⁹"[power]


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _or(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"

"""Recipes of kernels: a recipe names entries, and says what all that will run asks of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

from servotwin.models.engine.demands import certain, idle, impossible
from servotwin.simulation.compile.c_types import MATH

# --- Recipes of kernels: a recipe names entries, and says what all that will run asks of them -------------------------

@dataclass(frozen=True)
class Recipe:
    """The functions to derive.

    Parameters
    ----------
    name : str
        Start of the derived module's name.
    entries : tuple of str
        "module:function"; the derived module has each under the function's name.
    vector : bool
        Whether the kernels run on many lanes side by side: everything is inlined, and exponentials and logarithms
        become polynomials.
    single : bool
        Whether floats have 32 bits.
    knows : int
        Demands that they follow, of all that a servo may ask for (`engine.demands`): flags of `terms.dependence`.
    leaves : int
        Where numbers act that they leave to other kernels.
    always : int
        Demands of all servos that will run.
    never : tuple of str
        Constants of the engine that nothing will be equal to, beside those that come up by nothing that they follow.
    by_numbers : bool
        Whether C calls the entries with their whole numbers, instead of with words.
    in_floats : bool
        Whether the text made of it will be C of floats throughout: what is compared with rounding, and what
        exponentials and angles are made of, are those of `IN_FLOATS` of its module.
    parts : tuple of Recipe
        Of functions that are derived by recipes of their own, with all that they call: wherever one is called, what
        that recipe says is so.
    """

    name: str
    entries: tuple[str, ...]
    vector: bool = False
    single: bool = False
    knows: int = -1
    leaves: int = 0
    always: int = 0
    never: tuple[str, ...] = ()
    by_numbers: bool = False
    in_floats: bool = False
    parts: tuple[Recipe, ...] = ()

    @cached_property
    def absent(self) -> frozenset[str]:
        """Numbers of terms ("motor.L"), or of a command ("sweep"), that act in nothing that will run."""
        return frozenset(idle(self.knows | self.leaves))

    @cached_property
    def excluded(self) -> frozenset[str]:
        """Constants that nothing will be equal to: they have their neutral values, and what depends on others goes."""
        return frozenset((*self.never, *impossible(self.knows, self.always)))

    @cached_property
    def present(self) -> frozenset[str]:
        """Numbers of terms that are positive in all that will run ("firmware.T_c")."""
        return frozenset(certain(self.always))


# --- C of doubles as C of floats: the same text with other types, literals and functions of the library ---------------

_FUNCTIONS = re.compile(rf"\b({'|'.join((*MATH, 'fabs', 'floor', 'ceil', 'rint'))})\(")
_LITERALS = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)(?![\w.])")
_OWN = re.compile(r"\b(two_power|binary_exponent|scaled)f\b")


def in_floats(text: str) -> str:
    """Return a text of C with floats in the place of doubles.

    Examples
    --------
    >>> in_floats("double half = 0.5 * sqrt(x) + 1e-06;")
    'float half = 0.5f * sqrtf(x) + 1e-06f;'
    """
    text = re.sub(r"\bdouble\b", "float", _OWN.sub(r"\1", text))
    return _LITERALS.sub(r"\1f", _FUNCTIONS.sub(r"\1f(", text))

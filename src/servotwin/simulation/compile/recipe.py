"""What kernels are made of: a recipe names entries, and says what all that will run lacks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """What to derive.

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
    absent : tuple of str
        Terms ("heat"), or numbers of one ("motor.L", of an input "sweep"), that all that will run lack: they have their
        neutral values, and what depends on others is left out.
    never : tuple of str
        Constants that nothing will be equal to.
    present : tuple of str
        Numbers of terms that are positive in all that will run ("firmware.T_c").
    knows : int
        On what the acceleration may depend in what will run: flags of `terms.dependence`.
    spares : tuple of str
        Numbers of terms that it does well without, though other kernels read them: they act in what it leaves to them.
    by_numbers : bool
        Whether C calls the entries with their whole numbers, instead of with words.
    """

    name: str
    entries: tuple[str, ...]
    vector: bool = False
    single: bool = False
    absent: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    present: tuple[str, ...] = ()
    knows: int = -1
    spares: tuple[str, ...] = ()
    by_numbers: bool = False

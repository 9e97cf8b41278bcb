"""Kernels as a text that stands alone: structs with names of their own and functions over them.

It has no globals, allocates nothing, and says the same digits wherever doubles are those of IEEE 754. All functions are
`static`; who writes the text adds those that others call.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.simulation.compile.printing import Printer
from servotwin.simulation.compile.recipe import in_floats
from servotwin.simulation.compile.text.derive import derive
from servotwin.simulation.compile.text.inference import Module
from servotwin.simulation.compile.text.kinds import Kind
from servotwin.simulation.compile.text.translate import part_of_header

if TYPE_CHECKING:
    from servotwin.simulation.compile.c_types import Types
    from servotwin.simulation.compile.recipe import Recipe

_ONCE = frozenset({  # called at one place, with structs of a kilobyte that would be copied: a third of the time
    "run_alone__advance", "run_run__run", "run_run__from_step_to_step", "engine_memory__resumed",
    "engine_step__step", "engine_step__onward", "engine_step__follow", "motions_choice__begin",
    "motions_motion__nothing", "motions_motion__closed"})
_WHOLE, _INCLUDE = re.compile(r"\bint64_t\b(?! seed\b)"), re.compile(r"^#include .*\n", re.MULTILINE)
_SIZES = re.compile(r"\nCHECKED_SIZE\(.*?\);")


class Standalone:
    """A text in C that grows by the entries of recipes.

    Parameters
    ----------
    public : mapping of str to kind
        Structs that others see, by their names, each after those in it.
    floats : bool
        Whether numbers have 32 bits; recipes have to say so too.
    unstored : set of tuple of str
        Elements of named tuples that no struct has, as `Types` takes them.
    """

    def __init__(self, public: Mapping[str, Kind], *, floats: bool = False,
                 unstored: frozenset[tuple[str, str]] = frozenset()) -> None:
        self._floats = floats
        self._printer = Printer(frozenset(), frozenset(), frozenset(), _ONCE, unstored)
        for name, kind in public.items():
            self.types.call(kind, name)
        self._public = len(self.types.structs)
        self._results: dict[str, Kind | None] = {}

    @property
    def types(self) -> Types:
        """Names of values in the text."""
        return self._printer.types

    def add(self, recipe: Recipe, signatures: Mapping[str, Sequence[Kind]]) -> dict[str, str]:
        """Print the entries of a recipe, called with arguments of these kinds; return their names in C.

        Raises
        ------
        TranslationError
            If a kernel contains what has no form in C.
        """
        derived = derive(recipe)
        module = Module(derived)
        names = {}
        for entry, kinds in signatures.items():
            function = module.specialised(derived.entries[entry], tuple(kinds))
            names[entry] = self._printer.name_of(function)
            self._results[entry] = function.result
        return names

    def result_of(self, entry: str) -> str:
        """Return the type in C of what an entry returns."""
        return self.types.of(self._results[entry])

    @property
    def public(self) -> list[str]:
        """The structs that others see."""
        return [self.typed(_SIZES.sub("", each)) for each in self.types.structs[:self._public]]

    def typed(self, text: str) -> str:
        """Return C of doubles as C of what numbers are here."""
        return in_floats(text) if self._floats else text

    def narrowed(self) -> str:
        """Return the same as `private`, without headers; whole numbers have 32 bits, but for seeds and their draws."""
        types, functions = self.types, self._printer.functions
        for part in (types.structs, types.tables, types.helpers):
            part[:] = [_WHOLE.sub("int32_t", _SIZES.sub("", each)) for each in part]
        functions[:] = [each if "state_noise__" in each.split("(")[0] else _WHOLE.sub("int32_t", each)
                        for each in functions]
        return _INCLUDE.sub("", self.private)

    @property
    def private(self) -> str:
        """All else: what the functions stand on, and the functions."""
        types = self.types
        sizes = [size[1:] for each in types.structs[:self._public] for size in _SIZES.findall(each)]
        structs, bits = types.structs[self._public:], "doubles.h"
        if self._floats:
            sizes, structs, bits = [], [_SIZES.sub("", each) for each in structs], "floats.h"
        parts = (part_of_header(name) for name in ("standalone.h", "arithmetic.h", bits))
        return self.typed("\n".join([*parts, *sizes, *structs, *types.tables, *types.helpers, "",
                                     *self._printer.functions]))

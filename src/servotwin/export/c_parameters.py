"""The part of an exported servo that makes its table of parameters, where that is asked for."""

from __future__ import annotations

import math
from functools import reduce
from string import Template
from typing import Any

from servotwin.models.terms import chip, firmware, packing, wiring
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.rooms import NOTHING
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.kinds import Kind
from servotwin.simulation.compile.signatures import annotated
from servotwin.simulation.compile.standalone import Standalone

_TERMS = "servotwin.models.terms."

HEADER = Template('''/* The parameters of a servo by their names, as a servo file has them (SI), _ for the dot. NAN: not
 * given, as all have to be that the model does not read. A word is its place among those allowed, from 0 on. */
$parameters

/* What hangs on the shaft. */
$hung

/* The parameters and the load that the table is made of. */
extern const ${name}_parameters ${name}_given;
extern const ${name}_hung ${name}_given_load;

/* Make a table of other parameters, and of another load; all else of it stays. Return ${guard}_OTHER_CODE, and change
 * nothing, where these ask for what was left out. They are not checked. */
int ${name}_make(${name}_servo *servo, const ${name}_parameters *given, const ${name}_hung *load);

''')
SOURCE = Template('''const ${name}_parameters ${name}_given = $given;
const ${name}_hung ${name}_given_load = $load;

int ${name}_make(${name}_servo *servo, const ${name}_parameters *given, const ${name}_hung *load) {
    ${name}_servo next = *servo;
    next.numbers.plant = $pack(given, load$error);
    next.numbers.wiring = $wire(given$period);
    next.numbers.reduction = given->gear_gear_reduction;
    next.numbers.ambient = next.numbers.plant.heat.T_amb;
$logic    const ${name}_numbers *own = &next.numbers;
    if (($demanded(&own->plant, &own->chip, $program, &(const Piece){0}) & ~INT64_C($flags)) != 0)
        return ${guard}_OTHER_CODE;
    if ($absent)
        return ${guard}_OTHER_CODE;
    *servo = next;
    return 0;
}

''')


def recipes(kind: str, *, pulses: bool, program: bool) -> tuple[Recipe, Recipe]:
    """Return the recipes of what makes the numbers of a servo, and of how it is told."""
    logic = (f"{_TERMS}firmware:pack",) if program else (f"{_TERMS}chip:pack",) if pulses else ()
    return (Recipe("making", (f"{_TERMS}packing:{kind}", "servotwin.models.engine.demands:demanded", *logic)),
            Recipe("telling", (f"{_TERMS}wiring:{kind}",)))


def printed(text: Standalone, kind: str, *, pulses: bool, program: bool) -> dict[str, str]:
    """Print what makes the numbers of a servo; return the names of its functions in C."""
    from servotwin.models.engine.demands import demanded

    making, telling = recipes(kind, pulses=pulses, program=program)
    functions: dict[str, Any] = {kind: getattr(packing, kind), "demanded": demanded}
    if program or pulses:
        functions["pack"] = firmware.pack if program else chip.pack
    names = text.add(making, {name: annotated(function) for name, function in functions.items()})
    told: dict[str, tuple[Kind, ...]] = {kind: annotated(getattr(wiring, kind))}
    return {"pack": names[kind], "demanded": names["demanded"], "logic": names.get("pack", ""),
            "wire": text.add(telling, told)[kind]}


def is_absent(recipe: Recipe, *, pulses: bool, program: bool) -> str:
    """Return the condition that a number is not what it is where its term is absent, of those that code leaves out."""
    found = []
    for path in sorted(recipe.absent):
        room, *fields = path.split(".")
        if not fields or path == "heat.T_amb":
            continue
        if room in Numbers._fields:
            place = f"own->plant.{room}"
        elif room == "chip" and pulses and not program:
            place = "own->chip"
        elif room == "firmware" and program:
            place = "next.program"
        else:
            continue
        neutral: float = reduce(getattr, fields, NOTHING[room])
        value = f"{'-' if neutral < 0 else ''}INFINITY" if math.isinf(neutral) else repr(float(neutral))
        found.append(f"!({'.'.join([place, *map(identifier, fields)])} == {value})")
    return "\n        || ".join(found) or "0"

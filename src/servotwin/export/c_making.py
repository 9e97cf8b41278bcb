"""The function of an exported servo that makes its numbers of parameters, around the kernels that pack them."""

from __future__ import annotations

import math
from functools import reduce
from string import Template
from typing import TYPE_CHECKING, Any

from servotwin.export.features import APART
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, DigitalServo
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.given import Given, Hung, hung_of
from servotwin.models.terms.numbers import NOTHING, Numbers
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.kinds import FLOAT64, Kind
from servotwin.simulation.compile.signatures import named

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.engine.run.alone import Alone
    from servotwin.simulation.compile.standalone import Standalone

_KERNELS = "servotwin.models.engine.run.alone"
_ENTRIES = ((BoundedServo, "bounded"), (AveragedServo, "averaged"), (AveragedServoInductive, "averaged"),
            (DigitalServo, "digital"))
_MAKING = Template('''
const ${name}_given ${name}_given_table = $given;

int ${name}_make(${name}_servo *servo, const ${name}_given *given) {
    static const $hung hung = $load;
    ${name}_servo next = ${name}_table;
    next.numbers = $made(given, &hung, $error, $torque, $accuracy);
$program    const ${name}_numbers *own = &next.numbers;
    if (($asks(own, $own_program) & ~INT64_C($flags)) != 0
        || $absent)
        return ${guard}_OTHER_CODE;
    *servo = next;
    return 0;
}
''')
_PROGRAM = Template('''    typedef char same_words[sizeof(next.program) == sizeof($kind) ? 1 : -1];
    const $kind program = $made(given);
    memcpy(&next.program, &program, sizeof(same_words) * sizeof program);
''')


def making(text: Standalone, recipe: Recipe, model: Any, load: Load, alone: Alone, *, name: str) -> str:
    """Return the function that makes a servo of what is given of it, and print its kernels into a text.

    It refuses what asks for something that the code does not follow, which the recipe says.
    """
    digital = isinstance(model, DigitalServo)
    made = next((entry for kind, entry in _ENTRIES if isinstance(model, kind)), "pulsed")
    entries: dict[str, tuple[Kind, ...]] = {made: (named(Given), named(Hung), FLOAT64, FLOAT64, FLOAT64),
                                            "asks": (named(type(alone)), named(Firmware))}
    entries |= {"program": (named(Given),)} if digital else {}
    names = text.add(Recipe("alone_making", tuple(f"{_KERNELS}:{entry}" for entry in entries)), entries)
    types = text.types
    program = _PROGRAM.substitute(kind=types.of(named(Firmware)), made=names["program"]) if digital else ""
    return _MAKING.substitute(
        name=name, guard=name.upper(), made=names[made], program=program, asks=names["asks"],
        own_program="&program" if digital else f"&(const {types.of(named(Firmware))}){{0}}", flags=str(recipe.knows),
        absent=_is_absent(recipe, chip=alone.chip.frame_period > 0.0, digital=digital), hung=types.of(named(Hung)),
        load=types.initial(named(Hung), hung_of(load)), given=types.initial(named(Given), model.given),
        error=repr(float(getattr(model, "standing_error", 0.0))),  # of a servo without pulses nothing stands
        torque=repr(float(alone.torque)), accuracy=repr(alone.accuracy))


def _is_absent(recipe: Recipe, *, chip: bool, digital: bool) -> str:
    """Return the condition that a number is not what it is where its term is absent, of those that code leaves out."""
    places = {name: f"own->plant.{name}" for name in Numbers._fields}
    places |= ({"chip": "own->chip"} if chip else {}) | ({"firmware": "next.program"} if digital else {})
    found = []
    for path in sorted(recipe.absent):
        room, *fields = path.split(".")
        if room in places and path not in APART:
            neutral: float = reduce(getattr, fields, NOTHING[room])
            value = f"{'-' if neutral < 0.0 else ''}INFINITY" if math.isinf(neutral) else repr(float(neutral))
            found.append(f"!({'.'.join([places[room], *map(identifier, fields)])} == {value})")
    return "\n        || ".join(found) or "0"

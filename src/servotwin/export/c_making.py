"""The function of an exported servo that makes its numbers of parameters, around the kernels that pack them."""

from __future__ import annotations

from string import Template
from typing import TYPE_CHECKING, Any

from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, DigitalServo
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.given import Given
from servotwin.models.terms.hung import Hung, hung_of
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.kinds import FLOAT64, Kind
from servotwin.simulation.compile.signatures import named

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.engine.alone import Alone
    from servotwin.simulation.compile.standalone import Standalone

_KERNELS = "servotwin.models.engine.alone_making"
_ENTRIES = ((BoundedServo, "bounded"), (AveragedServo, "averaged"), (AveragedServoInductive, "averaged"),
            (DigitalServo, "digital"))
_MAKING = Template('''
const ${name}_given ${name}_given_table = $given;

void ${name}_make(${name}_servo *servo, const ${name}_given *given) {
    static const $hung hung = $load;
    *servo = ${name}_table;
    servo->numbers = $made(given, &hung, $error, $torque, $accuracy);
$program}
''')
_PROGRAM = Template('''    typedef char same_words[sizeof(servo->program) == sizeof($kind) ? 1 : -1];
    const $kind program = $made(given);
    memcpy(&servo->program, &program, sizeof(same_words) * sizeof program);
''')


def making(text: Standalone, model: Any, load: Load, alone: Alone, *, name: str) -> str:
    """Return the function that makes a servo of what is given of it, and print its kernels into a text."""
    digital = isinstance(model, DigitalServo)
    made = next((entry for kind, entry in _ENTRIES if isinstance(model, kind)), "pulsed")
    entries: dict[str, tuple[Kind, ...]] = {made: (named(Given), named(Hung), FLOAT64, FLOAT64, FLOAT64)}
    entries |= {"program": (named(Given),)} if digital else {}
    names = text.add(Recipe("alone_making", tuple(f"{_KERNELS}:{entry}" for entry in entries)), entries)
    types = text.types
    program = _PROGRAM.substitute(kind=types.of(named(Firmware)), made=names["program"]) if digital else ""
    return _MAKING.substitute(
        name=name, made=names[made], program=program, hung=types.of(named(Hung)),
        load=types.initial(named(Hung), hung_of(load)), given=types.initial(named(Given), model.given),
        error=repr(float(model.standing_error)), torque=repr(float(alone.torque)), accuracy=repr(alone.accuracy))

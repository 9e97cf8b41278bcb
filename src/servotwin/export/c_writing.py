"""How a servo gets into C: its kernels, structs and numbers, put into the header and the source."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import __version__
from servotwin.export.c_header import HEADER, MADE, events_of, signals_of
from servotwin.export.c_making import making
from servotwin.export.c_source import ADVANCING, IN_PARTS, SOURCE
from servotwin.export.features import features_of, left_out, recipe_of
from servotwin.models import (
    AveragedServo,
    AveragedServoInductive,
    BoundedServo,
    DigitalServo,
)
from servotwin.models.engine.log import COUNTS, EVENTS, LEFT, Happened, Log, Row
from servotwin.models.engine.memory import BEAT, Inputs, Lowest, Memories, Memory, Point
from servotwin.models.engine.run.alone import Alone, Seen
from servotwin.models.outputs import SIGNALS
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import numbers_in, record_of
from servotwin.models.terms import wiring
from servotwin.models.terms.control import Firm
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip, Decision, Frame
from servotwin.models.terms.given import Given
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import table_of
from servotwin.models.terms.wiring import Wiring
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile.kinds import FLOAT64, INT64, Array, Kind, Record, Tuple
from servotwin.simulation.compile.signatures import named
from servotwin.simulation.compile.standalone import Standalone
from servotwin.text import c_comment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.loads import Load
from servotwin.export.c_text import CCode

_COMMANDS = ("command_voltage", "command_angle", "pulse_width")  # are what the caller says
_SAME, _NEARLY = "the digits are the same, but for rounding", "angles are those to about 1e-5 rad"
_CURVE = ("    const double *curve; /* of the potentiometer: angle [rad] and error [V] */\n"
          "    int64_t curve_rows;\n")
_PASSING = ("        state->firm.tick -= frames;\n"
            "        state->firm.heard -= (float)passed, state->firm.hears -= (float)passed;\n")
_BEAT = "    double beat; /* by which the clock counts [s], in all its digits */\n"
_TABLE = Array(FLOAT64, 2)
_PROGRAM, _FIRM, _MEMORY, _EVENT = (Record(record_of(kind)) for kind in (Firmware, Firm, Memory, Happened))
_RECORDS: dict[Kind, str] = {Record(record_of(kind)): kind.__name__ for kind in (
    Firmware, Firm, Memory, Happened, Lowest, Point, Vector, Mode, Frame, Decision, Piece)}
_OWN_NAMES = {"Numbers": "plant", "Alone": "numbers", "Firmware": "program", "Happened": "event"}


class Writing:
    """The numbers of one servo on their way into C."""

    def __init__(self, model: Any, load: Load, name: str, accuracy: float, *, makes: bool, floats: bool) -> None:
        self._model, self._load, self._name, self._makes, self._floats = model, load, name, makes, floats
        self._program: Firmware = model.firmware() or NO_FIRMWARE
        self._chip: Chip = model.chip() or NO_CHIP
        self._curve = table_of(model.curve())
        self._numbers: Numbers = model.pack(load)
        N = model.value("gear.gear_reduction")
        self._alone = Alone(self._numbers, self._chip, wiring_of(model), N, load.torque, self._numbers.heat.T_amb,
                            accuracy)
        self._digital = isinstance(model, DigitalServo)

    def code(self) -> CCode:
        """Return header and source."""
        flags = features_of_model(self._model, self._load)
        text = Standalone(self._public(), floats=self._floats)
        recipe = replace(recipe_of(flags), in_floats=self._floats)
        names = text.add(recipe, _signatures())
        made = making(text, recipe, self._model, self._load, self._alone, name=self._name) if self._makes else ""
        servo = c_comment(self._model.servo.name)
        shared = {
            "name": self._name, "guard": self._name.upper(), "version": __version__, "id": servo,
            "title": f"{self._name}: {servo} as a {type(self._model).__name__}.",
            "real": text.typed("double"), "zero": "state->begun + " if self._floats else "",
            "begun": "state->seed = seed, state->begun = 0.0;" if self._floats else "state->seed = seed;",
            "digits": _NEARLY if self._floats else _SAME}
        return CCode(self._name, HEADER.substitute(shared | self._of_header(text, flags)),
                     self._source(text, shared | names) + made, left_out(flags), self.table)

    @property
    def table(self) -> tuple[float, ...]:
        """All numbers of the table in its order."""
        return tuple(map(float, numbers_in((self._alone, *((self._program,) if self._digital else ())))))

    def _public(self) -> dict[str, Kind]:
        """Return the structs of the header by their names, each after those in it."""
        roots: list[Kind] = [named(Alone), _MEMORY, _EVENT]
        if self._digital:
            roots += [_PROGRAM, _FIRM]
        if self._makes:
            roots.append(named(Given))
        structs = dict.fromkeys(kind for root in roots for kind in (*_within(root), root))
        return {f"{self._name}_{_name_of(kind)}": kind for kind in structs}

    def _source(self, text: Standalone, words: dict[str, str]) -> str:
        words |= {name: text.typed(part) for name, part in self._of_source(text).items()}
        words["since"] = "    piece[0] = (float)-state->begun;\n" if self._floats else ""
        words["passing"] = _PASSING if self._digital else ""
        words["beat"] = f",\n    {self._beat!r}" if self._floats else ""
        advancing = (IN_PARTS if self._floats else ADVANCING).substitute(words)
        return SOURCE.substitute(words, kernels=self._kernels(text), advancing=advancing)

    @property
    def _beat(self) -> float:
        """By which the memory of the servo counts time [s]."""
        return self._program.T_c if self._digital else self._chip.frame_period or BEAT

    def _of_header(self, text: Standalone, flags: int) -> dict[str, str]:
        name, structs = self._name, text.public
        event = next(each for each in structs if each.endswith(f" {name}_event;"))
        goals = self._alone.wiring.per_angle == 1.0
        return {
            "structs": "\n".join(map(_laid_out, (each for each in structs if each is not event))),
            "event": _laid_out(event), "events": events_of(name.upper()),
            "command": "a goal [rad]" if goals else "the width of a pulse [s]",
            "example": f"{self._alone.wiring.at_zero + self._alone.wiring.per_angle:.6g}",
            "absent": textwrap.fill(f"{left_out(flags)}.", 110, initial_indent=" * ", subsequent_indent=" * "),
            "making": MADE.substitute(name=name, guard=name.upper()) if self._makes else "",
            "signals": text.typed(signals_of(self._signals())),
            "since": " since the call began" if self._floats else "",
            "more": self._members((f"    {name}_program program;\n", self._digital),
                                  (text.typed(_CURVE), len(self._curve) > 0), (_BEAT, self._floats)),
            "remembered": self._members(
                (f"    {name}_firm firm; /* of its program */\n", self._digital),
                ("    double begun; /* from when the times of the memory count [s] */\n", self._floats))}

    @staticmethod
    def _members(*parts: tuple[str, bool]) -> str:
        return "".join(line for line, there in parts if there)

    def _of_source(self, text: Standalone) -> dict[str, str]:
        name, types = self._name, text.types
        table = [f"    {types.initial(named(Alone), self._alone)}"]
        if self._digital:
            table.append(f"    {{{', '.join(types.initial(FLOAT64, float(x)) for x in self._program)}}}")
        if self._curve:
            table.append(f"    {name}_curve, {len(self._curve)}")
        return {
            "table": ",\n".join(table).replace(", (-", ", (-") + "\n",
            "memories": types.of(_MEMORIES), "inputs": types.of(_INPUTS), "seen": types.of(named(Seen)),
            "rows": types.of(Array(_EVENT, 1)), "log": types.of(_LOG),
            "counts": f"{COUNTS}", "left": f"{LEFT}", "events": f"{EVENTS}",
            "firms": "{&own->firm, {1}}" if self._digital else "{NULL, {0}}",
            # the memory is written at the end of a call, but what a program remembers changes on the way
            "keeping": self._members((f"    const {name}_firm before = state->firm;\n", self._digital)),
            "restoring": self._members(("    if (status != 0)\n        state->firm = before;\n", self._digital)),
            "period": ("servo->program.T_f" if self._digital else
                       "servo->numbers.chip.frame_period" if self._chip.frame_period > 0.0 else "0.0"),
            "curve": ("{(double *)(uintptr_t)servo->curve, {servo->curve_rows, 2}}" if self._curve
                      else "{NULL, {0, 2}}"),
            "program": (f"{{({name}_program *)(uintptr_t)&servo->program, {{1}}}}" if self._digital
                        else "{NULL, {0}}"),
            "signals": "\n".join(f"    signals->{signal} = {self._read(signal)};" for signal, *_ in self._signals())}

    def _kernels(self, text: Standalone) -> str:
        if not self._curve:
            return text.private
        rows = ", ".join(repr(float(x)) for row in self._curve for x in row)
        return text.private + text.typed(f"\nstatic const double {self._name}_curve[] = {{{rows}}};\n")

    def _signals(self) -> list[tuple[str, str, str]]:
        """Return names, units and meanings of the signals that the servo has."""
        return signals_of_model(self._model, self._load)

    @staticmethod
    def _read(signal: str) -> str:
        return f"seen.{signal}" if signal in ("output_angle", "output_speed") else f"seen.shown.{signal}"


def signals_of_model(model: Any, load: Load) -> list[tuple[str, str, str]]:
    """Return names, units and meanings of the signals of a servo in C."""
    return [(name, SIGNALS[name].unit, SIGNALS[name].meaning) for name in model.signals_with(load)
            if name not in _COMMANDS]


def features_of_model(model: Any, load: Load) -> int:
    """Return what the code of a servo has to follow: flags of `terms.dependence`."""
    return features_of(model.pack(load), model.chip() or NO_CHIP, model.firmware() or NO_FIRMWARE,
                       len(table_of(model.curve())) > 0)


def wiring_of(model: Any) -> Wiring:
    """Return how a model is told."""
    if isinstance(model, BoundedServo):
        return wiring.bounded(model.given)
    if isinstance(model, AveragedServo | AveragedServoInductive):
        return wiring.averaged(model.given)
    return (wiring.digital if isinstance(model, DigitalServo) else wiring.pulsed)(model.given, np.nan)


def _tuple(kind: Any, **fields: Kind) -> Tuple:
    return Tuple(tuple(fields[name] for name in kind._fields), kind.__name__, kind._fields)


_MEMORIES = _tuple(Memories, rows=Array(_MEMORY, 1), firms=Array(_FIRM, 1))
_INPUTS = _tuple(Inputs, command=_TABLE, torque=_TABLE, constant_torque=FLOAT64, period=FLOAT64,
                 edges=Array(FLOAT64, 1), curve=_TABLE, seed=INT64, accuracy=FLOAT64, firmware=Array(_PROGRAM, 1))


_LOG = _tuple(Log, motions=Array(Record(record_of(Row)), 1), events=Array(_EVENT, 1), numbers=Array(FLOAT64, 1),
              counts=Array(INT64, 1))


@cache
def _signatures() -> dict[str, tuple[Kind, ...]]:
    """Return what the entries are called with."""
    alone = named(Alone)
    return {"start": (alone, _TABLE, _MEMORIES, FLOAT64),
            "advance": (alone, _INPUTS, _MEMORIES, FLOAT64, FLOAT64, _LOG),
            "answer": (alone, FLOAT64, FLOAT64), "observe": (alone, _INPUTS, _MEMORIES)}


def _within(kind: Kind) -> Iterator[Kind]:
    """Return the structs within a struct, each after those in it."""
    inner: list[Kind] = []
    if isinstance(kind, Tuple):
        inner = [each for each in kind.elements if isinstance(each, Tuple)]
    elif isinstance(kind, Record):
        inner = [Record(kind.dtype[place]) for place in kind.dtype.names or () if kind.dtype[place].names]
    for each in inner:
        yield from _within(each)
        yield each


def _name_of(kind: Kind) -> str:
    """Return what a struct is called, behind the name of the servo."""
    name = kind.name if isinstance(kind, Tuple) else _RECORDS[kind]
    return _OWN_NAMES.get(name, name.lower())


def _laid_out(struct: str) -> str:
    """Return a struct with a member on each line."""
    head, _, rest = struct.partition("{ ")
    body, _, name = rest.rpartition(" }")
    return "\n".join([f"{head}{{", *(f"    {each.strip()};" for each in body.split(";") if each.strip()), f"}}{name}"])

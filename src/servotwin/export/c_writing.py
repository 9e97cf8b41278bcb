"""How a servo gets into C: its kernels, structs and numbers, put into the header and the source."""

from __future__ import annotations

import math
import os
import tempfile
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import __version__
from servotwin.errors import OutputError, OutputExistsError
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, DigitalServo
from servotwin.models.engine.events.crossings import NAMES
from servotwin.models.engine.log import COUNTS, EVENTS, LEFT, Happened, Log, Row
from servotwin.models.engine.memory import BEAT, Inputs, Lowest, Memories, Memory, Point
from servotwin.models.engine.run.alone import Alone, Seen
from servotwin.models.outputs import SIGNALS
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import numbers_in, record_of
from servotwin.models.terms import wiring
from servotwin.models.terms.control import Firm
from servotwin.models.terms.dependence import (
    PROGRAM,
    PWM,
    TABLE,
)
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip, Decision, Frame
from servotwin.models.terms.given import Given, Hung, hung_of
from servotwin.models.terms.numbers import APART, NOTHING, Numbers
from servotwin.models.terms.sensor import table_of
from servotwin.models.terms.wiring import Wiring
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.signatures import named
from servotwin.simulation.compile.standalone import Standalone
from servotwin.simulation.compile.text.kinds import FLOAT64, INT64, Array, Kind, Record, Tuple
from servotwin.simulation.lanes.forms import WORDS, Terms
from servotwin.text import c_comment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.loads import Load


# --- The header of an exported servo: structs, what calls return, functions -------------------------------------------

HEADER = Template('''/* $title
 *
 * Printed by servotwin $version from the kernels that simulate it in Python: $digits.
 * C99, no allocation, no globals, SI units. Compile ${name}.c beside it and link with the maths library.
 *
 *     ${name}_state servo;
 *     ${name}_signals now;
 *     ${name}_init(&servo, &${name}_table, $example, 0);
 *     ${name}_advance(&servo, &${name}_table, 0.02, $example, 0.0, NULL);
 *     ${name}_observe(&servo, &${name}_table, $example, 0.0, &now);
 *
 * The command is $command. Several servos are several states; a state may be copied,
 * kept and taken up again. What the servo does not have is left out of the code:
$absent
 */
#ifndef ${guard}_H
#define ${guard}_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What a call returns. Unless it is ${guard}_DONE, nothing has changed. */
enum {
    ${guard}_DONE = 0,
    ${guard}_DIVERGED = 1,       /* numbers beyond what one holds */
    ${guard}_STEP_TOO_SMALL = 2, /* a motion that no step is short enough for */
    ${guard}_CHATTER = 3,        /* events without time going on */
    ${guard}_TOO_FAST = 4,       /* more oscillations than can be followed */
    ${guard}_CROWDED = 5,        /* pulses that come before two others are decided upon */
    ${guard}_NOT_FINITE = -1,    /* a time or a torque is no number */
    ${guard}_BAD_COMMAND = -2,   /* a command that the servo does not take, or no number */
    ${guard}_IN_THE_PAST = -3,   /* the servo is further already */
    ${guard}_OTHER_CODE = -4     /* parameters that ask for what was left out of this code */
};

/* What happens, of an event. */
enum {
$events
};

/* What the servo is, term by term, at its output shaft; lengths of time in seconds, words as numbers. */
$structs

typedef struct {
    ${name}_numbers numbers;
$more} ${name}_servo;

/* All that it remembers. */
typedef struct {
    ${name}_memory memory;
$remembered    int64_t seed;
} ${name}_state;

/* Something that happened: when [s$since], at which output angle [rad], and what. */
$event

/* Room for events; `count` is set to how many there were, of which the first `room` are kept. */
typedef struct {
    ${name}_event *rows;
    int64_t room;
    int64_t count;
} ${name}_events;

/* Signals (SI), those of the motor at its own shaft. */
typedef struct {
$signals
} ${name}_signals;

/* The numbers of $id. */
extern const ${name}_servo ${name}_table;

/* Put the servo to rest at t = 0, where it has no error under a command; the seed is that of its noise. */
int ${name}_init(${name}_state *state, const ${name}_servo *servo, $real command, int64_t seed);

/* Go on to a time since the start [s] under a command from now on, and a torque that is constant meanwhile, beside that
 * of the load; positive pushes towards -q [N m]. `events` may be NULL. */
int ${name}_advance(${name}_state *state, const ${name}_servo *servo, double until, $real command, $real torque,
    ${name}_events *events);

/* Look at the servo as it stands, before anything happens at its time. */
int ${name}_observe(const ${name}_state *state, const ${name}_servo *servo, $real command, $real torque,
    ${name}_signals *signals);

/* The time since the start [s]. */
double ${name}_time(const ${name}_state *state);

/* The command under which the servo has no error at an angle [rad]. */
$real ${name}_command(const ${name}_servo *servo, $real angle);
$making
#ifdef __cplusplus
}
#endif

#endif
''')

MADE = Template('''
/* The parameters of the servo file, SI, words as their places among those allowed; NAN: not given. */
extern const ${name}_given ${name}_given_table;

/* Make a servo of parameters, with the load of the table; ${guard}_OTHER_CODE, and nothing changes, where they ask
 * for what was left out. They are not checked otherwise. */
int ${name}_make(${name}_servo *servo, const ${name}_given *given);
''')


def events_of(guard: str) -> str:
    """Return the numbers of all events."""
    first = [(number, words) for number, words in enumerate(NAMES) if NAMES.index(words) == number]
    return ",\n".join(f"    {guard}_{words.upper().replace(' ', '_')} = {number}" for number, words in first)


def signals_of(names: Sequence[tuple[str, str, str]]) -> str:
    """Return the members of the struct of signals, each with unit and meaning."""
    width = max(len(name) for name, *_ in names)
    return "\n".join(f"    double {name};{' ' * (width - len(name))} /* {meaning} [{unit}] */"
                     for name, unit, meaning in names)


# --- The source of an exported servo, around its kernels: its numbers, and the functions that others call -------------

SOURCE = Template('''/* $title
 *
 * Printed by servotwin $version from its kernels; see $name.h.
 */
#include "$name.h"

$kernels
const ${name}_servo ${name}_table = {
$table$beat};

/* The memory of a servo as the kernels take it. */
static $memories memories_of(const ${name}_state *state) {
    ${name}_state *own = (${name}_state *)(uintptr_t)state;
    $memories all = {{&own->memory, {1}}, $firms};
    return all;
}

/* What a servo is told, with room for its one command. */
static $inputs inputs_of(const ${name}_state *state, const ${name}_servo *servo, $real command, $real torque,
    $real *piece) {
    $inputs all = {{piece, {1, 7}}, {NULL, {0, 7}}, torque + servo->numbers.torque, $period, {NULL, {0}}, $curve,
        state->seed, servo->numbers.accuracy, $program};
    for (int k = 0; k < 7; k++)
        piece[k] = 0;
$since    piece[1] = servo->numbers.wiring.gain * command + servo->numbers.wiring.offset;
    return all;
}

int ${name}_init(${name}_state *state, const ${name}_servo *servo, $real command, int64_t seed) {
    const $memories all = memories_of(state);
    const array_double_2 curve = $curve;
    const int status = (int)$start(&servo->numbers, curve, &all, command);
    if (status == 0)
        $begun
    return status;
}

$advancing
int ${name}_observe(const ${name}_state *state, const ${name}_servo *servo, $real command, $real torque,
    ${name}_signals *signals) {
    $real piece[7];
    const $memories all = memories_of(state);
    const $inputs told = inputs_of(state, servo, command, torque, piece);
    const int status = (int)$answer(&servo->numbers, command, torque);
    if (status != 0)
        return status;
    const $seen seen = $observe(&servo->numbers, &told, &all);
$signals
    return 0;
}

double ${name}_time(const ${name}_state *state) {
    return $zero(double)state->memory.frames * (double)state->memory.beat + (double)state->memory.point.time;
}

$real ${name}_command(const ${name}_servo *servo, $real angle) {
    return servo->numbers.wiring.per_angle * angle + servo->numbers.wiring.at_zero;
}
''')

ADVANCING = Template('''int ${name}_advance(
    ${name}_state *state, const ${name}_servo *servo, double until, double command, double torque,
    ${name}_events *events) {
    double piece[7];
    int64_t counts[$counts] = {[$left] = INT64_MAX};
    const $memories all = memories_of(state);
    const $inputs told = inputs_of(state, servo, command, torque, piece);
    const $rows rows = {events != NULL ? events->rows : NULL, {events != NULL ? events->room : 0}};
    const $log log = {{NULL, {0}}, rows, {NULL, {0}}, {counts, {$counts}}};
$keeping    const int status = (int)$advance(&servo->numbers, &told, &all, until, command, &log);
    if (events != NULL)
        events->count = counts[$events];
$restoring    return status;
}
''')

IN_PARTS = Template('''int ${name}_advance(
    ${name}_state *state, const ${name}_servo *servo, double until, float command, float torque,
    ${name}_events *events) {
    /* Times of the memory count from the end of the last part, so that floats have digits for them. */
    static const double longest = 0.25;
    const ${name}_state before = *state;
    const double now = ${name}_time(state);
    double left;
    float piece[7];
    int64_t counts[$counts] = {[$left] = INT64_MAX};
    int status;
    const $memories all = memories_of(state);
    const $inputs told = inputs_of(state, servo, command, torque, piece);
    const $rows rows = {events != NULL ? events->rows : NULL, {events != NULL ? events->room : 0}};
    const $log log = {{NULL, {0}}, rows, {NULL, {0}}, {counts, {$counts}}};
    if (!(until - until == 0.0))
        return ${guard}_NOT_FINITE;
    do {
        const float late = (float)(state->begun - now);
        const int64_t kept = counts[$events];
        left = until - state->begun;
        const float part = (float)(left > longest ? longest : left);
        status = (int)$advance(&servo->numbers, &told, &all, part, command, &log);
        for (int64_t n = kept; n < counts[$events] && n < rows.n[0]; n++)
            rows.p[n].time += late;
        const int64_t frames = state->memory.frames;
        const double passed = (double)frames * servo->beat;
        state->begun += passed;
        state->memory.frames = 0;
$passing    } while (status == 0 && left > longest);
    if (events != NULL)
        events->count = counts[$events];
    if (status != 0)
        *state = before;
    return status;
}
''')


# --- The kernels that the code of a servo needs -----------------------------------------------------------------------

ENTRIES = ("start", "advance", "answer", "observe")


def recipe_of(flags: int) -> Recipe:
    """Return the recipe of a servo that asks for this; what else there is is left out."""
    always = PROGRAM | PWM if flags & PROGRAM else 0
    return Recipe("alone", tuple(f"servotwin.models.engine.run.alone:{entry}" for entry in ENTRIES), knows=flags,
                  always=always, never=("ALL", "READINGS"))


def left_out(flags: int) -> str:
    """Return in words what the code of a servo that asks for this does not follow."""
    return ", ".join(word for flag, word in WORDS.items() if not flags & flag) or "nothing"


# --- The function of an exported servo that makes its numbers of parameters, around the kernels that pack -------------

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
_MADE_PROGRAM = Template('''    typedef char same_words[sizeof(next.program) == sizeof($kind) ? 1 : -1];
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
    program = _MADE_PROGRAM.substitute(kind=types.of(named(Firmware)), made=names["program"]) if digital else ""
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


# --- The two texts of a servo as C ------------------------------------------------------------------------------------

@dataclass(frozen=True)
class CCode:
    """A servo as C99.

    Attributes
    ----------
    name : str
        Begins the names of the files, types and functions.
    header, source : str
        The two texts.
    left_out : str
        Laws that the numbers of the servo do not use, and that the code does not follow.
    table : tuple of float
        All numbers of the servo in the order in which the struct of its table has them, the table of a potentiometer
        apart: what another servo with the same things left out may have in its place.
    """

    name: str
    header: str
    source: str
    left_out: str
    table: tuple[float, ...]

    def write(self, folder: str | Path, *, overwrite: bool = False) -> tuple[Path, Path]:
        """Write `name.h` and `name.c` into a folder, which is made where there is none; return their paths.

        Raises
        ------
        OutputExistsError
            If a file is there and `overwrite` is not given; then nothing has changed.
        OutputError
            If they cannot be written.
        """
        paths = Path(folder) / f"{self.name}.h", Path(folder) / f"{self.name}.c"
        for path in paths:
            if path.exists() and not overwrite:
                raise OutputExistsError(path)
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix=".servotwin-", dir=folder) as aside:
                for path, text in zip(paths, (self.header, self.source), strict=True):
                    (Path(aside) / path.name).write_text(text, encoding="utf-8")
                for path in paths:
                    os.replace(Path(aside) / path.name, path)
        except OSError as error:
            raise OutputError(f"{folder} cannot be written ({error.strerror or error})") from None
        return paths


# --- How a servo gets into C: its kernels, structs and numbers, put into the header and the source --------------------

_COMMANDS = ("command_voltage", "command_angle", "pulse_width")  # are what the caller says
_SAME, _NEARLY = "the digits are the same, but for rounding", "angles are those to about 1e-5 rad"
_CURVE = ("    const double *curve; /* of the potentiometer: angle [rad] and error [V] */\n"
          "    int64_t curve_rows;\n")
_PASSING = ("        state->firm.tick -= frames;\n"
            "        state->firm.heard -= (float)passed, state->firm.since -= (float)passed;\n")
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
    table = TABLE if len(table_of(model.curve())) > 0 else 0
    return Terms(model.pack(load), model.chip() or NO_CHIP, model.firmware() or NO_FIRMWARE, inputs=table).followed


def wiring_of(model: Any) -> Wiring:
    """Return how a model is commanded."""
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

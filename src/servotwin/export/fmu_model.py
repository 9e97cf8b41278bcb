"""What the functions of FMI have to know of one model, as a header in C."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from servotwin.export.fmu_variables import FIRST_PARAMETER, FIRST_SIGNAL, Variable
from servotwin.models.terms.given import field_of

_NAMES = ("servo", "state", "signals", "given", "table", "given_table", "make", "init", "advance", "observe",
          "command")
_CODES = ("DONE", "DIVERGED", "STEP_TOO_SMALL", "CHATTER", "TOO_FAST", "CROWDED", "NOT_FINITE", "BAD_COMMAND",
          "IN_THE_PAST", "OTHER_CODE")
_LESS = (("stops.lower_angle", "stops.upper_angle"),
         ("electronics.pulse_width_min", "electronics.pulse_width_max"),
         ("firmware.lower_goal", "firmware.upper_goal"))
_PLACES = ("TIME = 0, COMMAND = 1, TORQUE = 2, ANGLE = 3, FRAMES_BEGIN = 4", f"FIRST_SIGNAL = {FIRST_SIGNAL}",
           f"FIRST_PARAMETER = {FIRST_PARAMETER}")


def model_header(name: str, token: str, variables: Sequence[Variable], *, frames: str) -> str:
    """Return model.h; `frames` is the frame period of `servo` in C, 0.0 where it has none."""
    signals = [each for each in variables if each.causality == "output"]
    parameters = [each for each in variables if each.reference >= FIRST_PARAMETER]
    of = {each.reference: each for each in variables}
    given = {each.name for each in parameters}
    less = [(low, high) for low, high in _LESS if {low, high} <= given]
    start = {reference: 0.0 if (value := of[reference].start) is None else value for reference in (1, 3)}
    lines = [
        f"/* {name}: what the functions of FMI have to know of it. */", "#ifndef MODEL_H", "#define MODEL_H", "",
        "#include <math.h>", f'#include "{name}.h"', "", f'#define MODEL_TOKEN "{token}"',
        f"#define MODEL_COMMAND {start[1]!r}", f"#define MODEL_ANGLE {start[3]!r}",
        f"#define MODEL_FRAMES(s) ({frames})",
        f"#define HAS_FRAMES {int(frames != '0.0')}",
        *(f"#define MODEL_{code} {name.upper()}_{code}" for code in _CODES),
        *(f"#define model_{each} {name}_{each}" for each in _NAMES), "",
        f"enum {{ {', '.join(_PLACES)}, SIGNALS = {len(signals)}, PARAMETERS = {len(parameters)},"
        f" RELATIONS = {len(less)} }};",
        "typedef struct { double low, high; int open; const char *allowed; } model_limit;",
        "typedef struct { size_t low, high; const char *name, *allowed; } model_relation;", "",
        "static const size_t model_signal_places[] = {",
        *(f"    offsetof({name}_signals, {each.name})," for each in signals), "};",
        "static const size_t model_parameters[] = {",
        *(f"    offsetof({name}_given, {field_of(each.name)})," for each in parameters), "};",
        "static const model_limit model_limits[] = {", *(f"    {_limit(each)}," for each in parameters), "};",
        "static const model_relation model_relations[] = {",
        *(f"    {{offsetof({name}_given, {field_of(low)}), offsetof({name}_given, {field_of(high)}),"
          f" {json.dumps(low)}, {json.dumps('less than ' + high)}}}," for low, high in less),
        '    {0, 0, "", ""}', "};",
        "static const char *const model_names[] = {",
        *(f"    [{each.reference}] = {json.dumps(each.name)}," for each in variables), "};",
        f"static const char *const model_allowed[] = {{[COMMAND] = {json.dumps(of[1].allowed)}}};", "", "#endif", ""]
    return "\n".join(lines)


def _limit(variable: Variable) -> str:
    low, high = (("-INFINITY" if x < 0.0 else "INFINITY") if math.isinf(x) else repr(x)
                 for x in (variable.low, variable.high))
    return f"{{{low}, {high}, {int(variable.is_open)}, {json.dumps(variable.allowed)}}}"

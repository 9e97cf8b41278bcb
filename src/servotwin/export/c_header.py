"""The header of an exported servo: structs, what calls return, functions."""

from __future__ import annotations

from collections.abc import Sequence
from string import Template

from servotwin.models.engine.events.crossings import NAMES

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

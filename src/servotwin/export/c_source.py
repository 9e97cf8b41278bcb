"""The source of an exported servo, around its kernels: its numbers, and the functions that others call."""

from __future__ import annotations

from string import Template

SOURCE = Template('''/* $title
 *
 * Printed by servotwin $version from its kernels; see $name.h.
 */
#include "$name.h"

$kernels
const ${name}_servo ${name}_table = {
$table};

/* The memory of a servo as the kernels take it. */
static $memories memories_of(const ${name}_state *state) {
    ${name}_state *own = (${name}_state *)(uintptr_t)state;
    $memories all = {{&own->memory, {1}}, $firms};
    return all;
}

/* What a servo is told, with room for its one command. */
static $inputs inputs_of(const ${name}_state *state, const ${name}_servo *servo, double command, double torque,
    double *piece) {
    $inputs all = {{piece, {1, 7}}, {NULL, {0, 7}}, torque + servo->numbers.torque, $period, {NULL, {0}}, $curve,
        state->seed, servo->numbers.accuracy, $program};
    for (int k = 0; k < 7; k++)
        piece[k] = 0.0;
    piece[1] = servo->numbers.wiring.gain * command + servo->numbers.wiring.offset;
    return all;
}

int ${name}_init(${name}_state *state, const ${name}_servo *servo, double command, int64_t seed) {
    const $memories all = memories_of(state);
    const array_double_2 curve = $curve;
    const int status = (int)$start(&servo->numbers, curve, &all, command);
    if (status == 0)
        state->seed = seed;
    return status;
}

int ${name}_advance(${name}_state *state, const ${name}_servo *servo, double until, double command, double torque,
    ${name}_events *events) {
    double piece[7];
    int64_t count = 0;
    const $memories all = memories_of(state);
    const $inputs told = inputs_of(state, servo, command, torque, piece);
    const $rows rows = {events != NULL ? events->rows : NULL, {events != NULL ? events->room : 0}};
    const array_int64_t_1 used = {&count, {1}};
$keeping    const int status = (int)$advance(&servo->numbers, &told, &all, until, command, rows, used);
    if (events != NULL)
        events->count = count;
$restoring    return status;
}

int ${name}_observe(const ${name}_state *state, const ${name}_servo *servo, double command, double torque,
    ${name}_signals *signals) {
    double piece[7];
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
    return (double)state->memory.frames * state->memory.beat + state->memory.point.time;
}

double ${name}_command(const ${name}_servo *servo, double angle) {
    return servo->numbers.wiring.per_angle * angle + servo->numbers.wiring.at_zero;
}
''')

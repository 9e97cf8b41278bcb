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

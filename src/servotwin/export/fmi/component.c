/* A servo as a component of a co-simulation: numbers in, one step after the other, numbers out. */
#include "component.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static bool refuse(component *c, const char *text) {
    c->tell(c->of, true, text);
    return false;
}

static bool refuse_number(component *c, const char *name, double value, const char *allowed) {
    char text[300];
    snprintf(text, sizeof text, "%s: got %.17g, allowed: %s", name, value, allowed);
    return refuse(c, text);
}

void component_reset(component *c) {
    memset(&c->now, 0, sizeof c->now);
    c->now.given = model_given_table;
    c->now.servo = model_table;
    c->now.angle = MODEL_ANGLE;
    c->now.command = MODEL_COMMAND;
    c->fresh = false;
}

static bool outcome(component *c, int status) {
    switch (status) {
    case MODEL_DONE: return true;
    case MODEL_BAD_COMMAND: return refuse_number(c, model_names[COMMAND], c->now.command, model_allowed[COMMAND]);
    case MODEL_NOT_FINITE: return refuse_number(c, model_names[TORQUE], c->now.torque, "a finite number");
    case MODEL_IN_THE_PAST: return refuse(c, "the step: the servo is further already");
    case MODEL_STEP_TOO_SMALL: return refuse(c, "the servo cannot go on: no step is short enough for its motion");
    case MODEL_CHATTER: return refuse(c, "the servo cannot go on: events without time going on");
    case MODEL_TOO_FAST: return refuse(c, "the servo cannot go on: more oscillations than can be followed");
    case MODEL_CROWDED: return refuse(c, "the servo cannot go on: pulses before others are decided upon");
    case MODEL_OTHER_CODE: return refuse(c, "the parameters ask for something that was left out of this FMU");
    default: return refuse(c, "the servo cannot go on: numbers beyond what a double holds");
    }
}

/* Make the servo of what is given, at rest at its first angle, so that its frames begin when they shall. */
bool component_ready(component *c) {
    condition *now = &c->now;
    if (c->fresh)
        return true;
    for (size_t k = 0; k < PARAMETERS; k++) {
        const model_limit *limit = &model_limits[k];
        const double value = *(const double *)((const char *)&now->given + model_parameters[k]);
        if (!(value >= limit->low && value <= limit->high && !(limit->open && value == limit->low)))
            return refuse_number(c, model_names[FIRST_PARAMETER + k], value, limit->allowed);
    }
    for (size_t k = 0; k < RELATIONS; k++) {
        const double low = *(const double *)((const char *)&now->given + model_relations[k].low);
        const double high = *(const double *)((const char *)&now->given + model_relations[k].high);
        if (!(low < high))
            return refuse_number(c, model_relations[k].name, low, model_relations[k].allowed);
    }
    if (!outcome(c, model_make(&now->servo, &now->given)))
        return false;
    const double period = MODEL_FRAMES(&now->servo);
    if (!(now->frames_begin >= 0.0 && (now->frames_begin < period || now->frames_begin == 0.0)))
        return refuse_number(c, model_names[FRAMES_BEGIN], now->frames_begin, "from 0 to less than a frame period");
    const double lower = now->servo.numbers.wiring.lower, upper = now->servo.numbers.wiring.upper;
    if (!(now->angle >= lower && now->angle <= upper))
        return refuse_number(c, model_names[ANGLE], now->angle, "between its stops");
    const double rest = model_command(&now->servo, now->angle);
    if (model_init(&now->state, &now->servo, rest, 0) != MODEL_DONE)
        return refuse_number(c, model_names[ANGLE], now->angle, "an angle at which the servo can rest");
    now->ahead = now->frames_begin > 0.0 ? period - now->frames_begin : 0.0;
    if (now->ahead > 0.0 && !outcome(c, model_advance(&now->state, &now->servo, now->ahead, rest, 0.0, NULL)))
        return false;
    c->fresh = true;
    return true;
}

static double since_start(const condition *now, double time) {
    return time - now->start + now->ahead;
}

/* Go on by a step; where that may end early it ends with the frame. */
bool component_step(component *c, double at, double step, bool early, double *reached) {
    condition *now = &c->now;
    *reached = now->time;
    if (!component_ready(c))
        return false;
    if (!(fabs(at - now->time) <= 1e-9 * fmax(1.0, fabs(at))))
        return refuse_number(c, "the communication point", at, "where the last step has ended");
    if (!(step > 0.0 && step - step == 0.0))
        return refuse_number(c, "the communication step", step, "a positive number");
    double end = at + step;
    const double period = MODEL_FRAMES(&now->servo);
    if (early && period > 0.0) {
        const double frames = floor(since_start(now, at) / period + 1e-9) + 1.0;
        const double edge = frames * period - now->ahead + now->start;
        end = edge < end ? edge : end;
    }
    if (!outcome(c, model_advance(&now->state, &now->servo, since_start(now, end), now->command, now->torque, NULL)))
        return false;
    now->time = *reached = end;
    return true;
}

bool component_get(component *c, uint32_t reference, double *value) {
    condition *now = &c->now;
    if (reference == TIME)
        *value = now->time;
    else if (reference == COMMAND)
        *value = now->command;
    else if (reference == TORQUE)
        *value = now->torque;
    else if (reference == ANGLE)
        *value = now->angle;
    else if (reference == FRAMES_BEGIN && HAS_FRAMES)
        *value = now->frames_begin;
    else if (reference >= FIRST_PARAMETER && reference < FIRST_PARAMETER + PARAMETERS)
        *value = *(const double *)((const char *)&now->given + model_parameters[reference - FIRST_PARAMETER]);
    else if (reference >= FIRST_SIGNAL && reference < FIRST_SIGNAL + SIGNALS) {
        model_signals seen;
        if (!component_ready(c)
                || !outcome(c, model_observe(&now->state, &now->servo, now->command, now->torque, &seen)))
            return false;
        *value = *(const double *)((const char *)&seen + model_signal_places[reference - FIRST_SIGNAL]);
    } else
        return refuse(c, "a value reference: there is no such variable");
    return true;
}

bool component_set(component *c, uint32_t reference, double value) {
    condition *now = &c->now;
    double *place = NULL;
    if (reference == COMMAND)
        place = &now->command;
    else if (reference == TORQUE)
        place = &now->torque;
    else if (reference == ANGLE)
        place = &now->angle;
    else if (reference == FRAMES_BEGIN && HAS_FRAMES)
        place = &now->frames_begin;
    else if (reference >= FIRST_PARAMETER && reference < FIRST_PARAMETER + PARAMETERS)
        place = (double *)((char *)&now->given + model_parameters[reference - FIRST_PARAMETER]);
    else
        return refuse(c, "a value reference: there is no such variable that can be set");
    if (!(value - value == 0.0))
        return refuse_number(c, model_names[reference], value, "a finite number");
    if (reference != COMMAND && reference != TORQUE) {
        if (now->at != INSTANTIATED && now->at != INITIALIZING)
            return refuse_number(c, model_names[reference], value, "what it is once the simulation has begun");
        c->fresh = false;
    }
    *place = value;
    return true;
}

size_t component_size(void) {
    return sizeof MODEL_TOKEN + sizeof(condition);
}

void component_write(const condition *kept, uint8_t *bytes) {
    memcpy(bytes, MODEL_TOKEN, sizeof MODEL_TOKEN);
    memcpy(bytes + sizeof MODEL_TOKEN, kept, sizeof *kept);
}

bool component_read(component *c, condition *kept, const uint8_t *bytes, size_t size) {
    if (size != component_size() || memcmp(bytes, MODEL_TOKEN, sizeof MODEL_TOKEN) != 0)
        return refuse(c, "a state: it is of another model");
    memcpy(kept, bytes + sizeof MODEL_TOKEN, sizeof *kept);
    return outcome(c, model_make(&kept->servo, &kept->given)); /* whose addresses are those of this process */
}

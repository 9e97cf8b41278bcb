/* A servo as a component of a co-simulation, in whichever version of FMI it is asked. */
#ifndef SERVOTWIN_COMPONENT_H
#define SERVOTWIN_COMPONENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "model.h"

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } phase;

/* All that changes: what is kept of a component, and taken up again. */
typedef struct {
    phase at;
    double start;  /* of the simulation [s] */
    double time;   /* that it has come to [s] */
    double ahead;  /* by how much the servo's own time is ahead of that since the start [s] */
    double command, torque;
    double angle, frames_begin; /* at the start [rad], [s] */
    model_given given;
    model_servo servo;
    model_state state;
} condition;

typedef void (*teller)(void *of, bool failed, const char *text);

typedef struct {
    condition now;
    bool fresh; /* whether servo and state are those of the numbers that are given */
    teller tell;
    void *of;
} component;

/* All of these return whether that went well; what did not was told. */
void component_reset(component *c);
bool component_ready(component *c);
bool component_step(component *c, double at, double step, bool early, double *reached);
bool component_get(component *c, uint32_t reference, double *value);
bool component_set(component *c, uint32_t reference, double value);

/* A condition as bytes, which only the same model takes. */
size_t component_size(void);
void component_write(const condition *kept, uint8_t *bytes);
bool component_read(component *c, condition *kept, const uint8_t *bytes, size_t size);

#endif

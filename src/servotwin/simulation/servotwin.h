/* servotwin.h: go on by a tick with all lanes of a VectorSimulator, from C.
 *
 * Python makes the simulator and gives out an address of the function and one of a struct that is filled in:
 *
 *     entry = sims.c_entry()
 *     entry.address, ctypes.addressof(entry.tick())
 *
 * A call is what sims.set(...), sims.advance(...) and reading sims[...] are in Python, in this order and bit for bit;
 * both may take turns. Arrays have one number for each lane, SI. The caller owns them, and the struct. The simulator has
 * to live in Python for as long as it is called, and one thread at a time may call it; several simulators may go on in
 * several threads. No lock of Python is needed. It is taken only where a bus voltage makes a lane run in another way,
 * which falls below the drop of its bridge, or comes back, or takes the place of a regulator.
 */
#ifndef SERVOTWIN_H
#define SERVOTWIN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SERVOTWIN_VERSION 1

/* What servotwin_advance returns; unless it is SERVOTWIN_DONE, nothing has changed. */
enum {
    SERVOTWIN_DONE = 0,
    SERVOTWIN_NOTHING_GIVEN = 1,  /* no struct, or no simulator in it */
    SERVOTWIN_OTHER_VERSION = 2,  /* the struct has another version; nothing else of it was read */
    SERVOTWIN_OTHER_LANES = 3,    /* the struct has another number of lanes */
    SERVOTWIN_BAD_DURATION = 4,   /* not a number of seconds from 0 to 1e5 */
    SERVOTWIN_BAD_NUMBER = 5,     /* a number is not finite */
    SERVOTWIN_BAD_COMMAND = 6,    /* a command is not possible, or more than one is given */
    SERVOTWIN_BAD_ANGLE = 7,      /* an angle is beyond a stop */
    SERVOTWIN_BAD_INERTIA = 8,    /* an inertia is negative */
    SERVOTWIN_BAD_VOLTAGE = 9,    /* a bus voltage is not positive, or is one that lanes share */
    SERVOTWIN_BEYOND_RECORD = 10, /* a recorded torque ends before */
    SERVOTWIN_NOT_RENEWED = 11    /* lanes that run in another way now could not be prepared: inertias and bus voltages
                                     are imposed, but no time has gone by */
};

typedef struct servotwin_tick {
    int64_t version; /* SERVOTWIN_VERSION */
    int64_t lanes;   /* of the simulator */
    double duration; /* of the tick, from 0 to 1e5 [s] */
    void *simulator; /* as Python has given it */

    /* In, shape (lanes,). NULL: as before. One of the first three at most. */
    const double *pulse_width;     /* command from now on [s] */
    const double *command_angle;   /* [rad] */
    const double *command_voltage; /* [V] */
    const double *external_torque; /* constant, beside the load, from now on; positive pushes towards -q [N m] */

    /* In, shape (lanes,): what another simulator decides. NULL: not imposed now. */
    const double *set_output_angle; /* of the shaft, between its stops; with a speed, play stays as it is [rad] */
    const double *set_output_speed; /* an impulse; with play in the gear the motor keeps its own [rad/s] */
    const double *set_load_inertia; /* in the place of the load's, from now on, at least 0 [kg m2] */
    const double *set_bus_voltage;  /* at the bridge, from now on, positive [V] */

    /* Out, at the end of the tick, shape (lanes,). NULL: not wanted. nan: the lane has failed, or has no such signal. */
    double *output_angle;     /* [rad] */
    double *output_speed;     /* [rad/s] */
    double *load_torque;      /* what the load gets, its inertia and damping included [N m] */
    double *armature_current; /* [A] */
    double *bus_voltage;      /* [V] */
    double *supply_current;   /* negative where the servo returns it [A] */
    int8_t *status;           /* 0: well; else the code of servotwin.Status, until the lane is reset in Python */
} servotwin_tick;

/* The type of the function at the address that Python gives. */
typedef int32_t (*servotwin_advance)(servotwin_tick *tick);

#ifdef __cplusplus
}
#endif

#endif

/* The angle of a servo under random commands and torques; REAL is what its numbers are. */
#include <stdio.h>

#include "servo.h"

static uint64_t drawn = SEED;

static double uniform(double low, double high) {
    drawn ^= drawn << 13;
    drawn ^= drawn >> 7;
    drawn ^= drawn << 17;
    return low + (high - low) * ((double)(drawn >> 11) / 9007199254740992.0);
}

int main(void) {
    const servo_servo *numbers = &servo_table;
    const double low = (double)servo_command(numbers, (REAL)0.2), high = (double)servo_command(numbers, (REAL)2.0);
    servo_signals seen;
    servo_state servo;
    double until = 0.0;
    REAL command = (REAL)low, torque = (REAL)0.0;
    if (servo_init(&servo, numbers, command, 7) != 0)
        return 1;
    for (int k = 0; k < 400; k++) {
        if (k % 20 == 0) {
            command = (REAL)uniform(low, high);
            torque = (REAL)uniform(-0.05, 0.05);
        }
        until += uniform(0.0, 0.01);
        const int status = servo_advance(&servo, numbers, until, command, torque, NULL);
        if (status != 0 || servo_observe(&servo, numbers, command, torque, &seen) != 0)
            return 10 + status;
        printf("%.9g\n", (double)seen.output_angle);
    }
    return 0;
}

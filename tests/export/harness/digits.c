/* The bits of all signals of a servo under random commands and torques, some of which it does not take. */
#include <stdio.h>
#include <string.h>

#include "servo.h"

static uint64_t drawn = 88172645463325252u;

static double uniform(double low, double high) {
    drawn ^= drawn << 13;
    drawn ^= drawn >> 7;
    drawn ^= drawn << 17;
    const volatile double part = (high - low) * ((double)(drawn >> 11) / 9007199254740992.0); /* rounded before the sum */
    return low + part;
}

int main(void) {
    static const double odd[] = {1e6, -1e6, 1e300, -1e300};
    const servo_servo *numbers = &servo_table;
    const double low = servo_command(numbers, 0.2), high = servo_command(numbers, 2.0);
    const double inf = odd[2] * odd[2], nan = inf - inf;
    servo_event rows[16];
    servo_events events = {rows, 16, 0};
    servo_signals seen;
    servo_state servo;
    double until = 0.0, command = low, torque = 0.0;
    if (servo_init(&servo, numbers, low, 7) != 0)
        return 1;
    for (int k = 0; k < 400; k++) {
        if (k % 20 == 0) {
            command = uniform(low, high);
            torque = uniform(-0.05, 0.05);
        }
        until += uniform(0.0, 0.01);
        if (servo_advance(&servo, numbers, until, command, torque, &events) != 0)
            return 2;
        if (servo_observe(&servo, numbers, command, torque, &seen) != 0)
            return 3;
        const double *signals = (const double *)(const void *)&seen;
        for (size_t n = 0; n < sizeof seen / sizeof *signals; n++) {
            uint64_t bits;
            memcpy(&bits, &signals[n], sizeof bits);
            bits = signals[n] != signals[n] ? 0u : bits;
            printf("%08lx%08lx ", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu));
        }
        printf("%ld\n", (long)events.count);
        const double bad[] = {nan, inf, -inf, odd[k % 4]};
        for (int n = 0; n < 4; n++) {
            if (servo_advance(&servo, numbers, until + 1.0, bad[n], torque, NULL) == 0)
                return 4;
            if (n < 3 && servo_advance(&servo, numbers, bad[n], command, torque, NULL) == 0)
                return 5;
            if (n < 3 && servo_advance(&servo, numbers, until + 1.0, command, bad[n], &events) == 0)
                return 6;
        }
    }
    return 0;
}

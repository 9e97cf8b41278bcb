/* What an exported servo takes of a Cortex-M4: instructions of its calls, bytes of stack; all for whole numbers. */
#include <stdint.h>
#include <stdio.h>

#ifndef NOTHING
#include "servo.h"
#endif

#define CONTROL (*(volatile uint32_t *)0xE000E010) /* of SysTick, the counter of the processor */
#define RELOAD (*(volatile uint32_t *)0xE000E014)
#define COUNT (*(volatile uint32_t *)0xE000E018) /* goes down */
enum { MOST = 0xffffff, PAINTED = 32768, CALLS = 1500 };

#ifndef NOTHING
static servo_state servo;

/* Turns to and fro, a call each STEP; says what calls take, and what looks at the servo take. */
__attribute__((noinline)) static int go(unsigned long told[4]) {
    const REAL low = servo_command(&servo_table, (REAL)LOW), high = servo_command(&servo_table, (REAL)HIGH);
    servo_signals seen;
    if (servo_init(&servo, &servo_table, low, 0) != 0)
        return 1;
    for (int k = 1; k <= CALLS; k++) {
        const REAL command = k * STEP * 2.0 - 2.0 * (int)(k * STEP) < 1.0 ? low : high;
        const double until = STEP * k;
        const uint32_t begun = COUNT;
        if (servo_advance(&servo, &servo_table, until, command, (REAL)0.0, NULL) != 0)
            return 2;
        const uint32_t advanced = COUNT;
        if (servo_observe(&servo, &servo_table, command, (REAL)0.0, &seen) != 0)
            return 3;
        const uint32_t took = (begun - advanced) & MOST;
        told[0] += took, told[2] += (advanced - COUNT) & MOST;
        told[1] = took > told[1] ? took : told[1];
    }
    return 0;
}
#endif

int main(void) {
    unsigned long told[4] = {0, 0, 0, 0};
    int code = 0;
#ifndef NOTHING
    volatile unsigned char *top = __builtin_frame_address(0);
    for (int n = 256; n < PAINTED; n++)
        top[-n] = 0xA5;
    RELOAD = MOST, COUNT = 0, CONTROL = 5;
    code = go(told);
    int deep = PAINTED - 1;
    while (deep > 0 && top[-deep] == 0xA5)
        deep--;
    told[3] = (unsigned long)deep;
#endif
    printf("%lu %lu %lu %lu\n", told[0], told[1], told[2], told[3]);
    return code;
}

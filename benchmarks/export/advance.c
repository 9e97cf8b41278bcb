/* How long an exported servo takes for each call that goes on by 1 ms, and for a call to look at it. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "NAME.h"

static double now(void) {
    return (double)clock() / CLOCKS_PER_SEC;
}

int main(int count, char **words) {
    const int calls = count > 1 ? atoi(words[1]) : 1000000;
    NAME_state servo;
    NAME_signals seen = {0};
    double low = NAME_command(&NAME_table, LOW), high = NAME_command(&NAME_table, HIGH), sum = 0.0;
    if (NAME_init(&servo, &NAME_table, low, 0) != 0)
        return 1;
    const double begun = now();
    for (int k = 1; k <= calls; k++)
        if (NAME_advance(&servo, &NAME_table, 1e-3 * k, k / 500 % 2 ? high : low, 0.0, NULL) != 0)
            return 2;
    const double advanced = now();
    for (int k = 0; k < calls; k++) {
        if (NAME_observe(&servo, &NAME_table, low, 1e-9 * k, &seen) != 0)
            return 3;
        sum += seen.output_angle;
    }
    printf("%.9g %.9g %.17g\n", (advanced - begun) / calls, (now() - advanced) / calls, sum);
    return 0;
}

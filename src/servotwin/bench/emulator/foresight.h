/* Which voltages the program will ask for next: what it has done twice, it goes on with. They are asked for together, so
 * that the host is waited for once and not once for each. What does not come as foreseen, or comes after an edge of the
 * pulse, is asked for anew; so nothing but time depends on this. */
#include <stdint.h>

#define PAST 32   /* a power of two; twice the longest pattern */
#define AHEAD 8   /* asked for at once, measured: more are computed in vain where an edge comes */

struct asked { uint64_t cycle; uint8_t channel, reference; };

static struct asked past[PAST], foreseen[AHEAD];
static uint16_t answers[AHEAD];
static unsigned known, next_one, last_one; /* holds so far; the next answer, and the end of them */

static struct asked *back(unsigned k) { return &past[(known - 1 - k) % PAST]; }

static unsigned pattern(void) { /* how many holds ago everything was as it is now; 0: never */
    for (unsigned p = 1; p <= PAST / 2 && 2 * p <= known; p++) {
        uint64_t length = back(0)->cycle - back(p)->cycle;
        unsigned k = 0;
        while (k < p && back(k)->channel == back(k + p)->channel && back(k)->reference == back(k + p)->reference
               && back(k)->cycle - back(k + p)->cycle == length) k++;
        if (k == p) return p;
    }
    return 0;
}

static void forget(void) { next_one = last_one = 0; }

/* Take a voltage that is held now; return 1 where its answer is known already. */
static int is_foreseen(struct asked now, uint16_t *answer) {
    past[known++ % PAST] = now;
    if (known == 2 * PAST) known -= PAST;
    if (next_one == last_one) return 0;
    struct asked *one = &foreseen[next_one];
    if (one->cycle != now.cycle || one->channel != now.channel || one->reference != now.reference) {
        forget();
        return 0;
    }
    *answer = answers[next_one++];
    return 1;
}

/* Foresee what follows the latest hold before a cycle; return how many there are with itself, which is the first. */
static unsigned foresee(uint64_t end) {
    unsigned p = pattern(), n = 1;
    uint64_t length = p ? back(0)->cycle - back(p)->cycle : 0;
    foreseen[0] = *back(0);
    for (; p && n < AHEAD; n++) {
        foreseen[n] = n < p ? *back(p - n) : foreseen[n - p];
        foreseen[n].cycle += length;
        if (foreseen[n].cycle >= end) break;
    }
    next_one = 1;
    last_one = n;
    return n;
}

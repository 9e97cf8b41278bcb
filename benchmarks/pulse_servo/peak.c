/* The most fused multiply-adds that this machine does: independent chains, kept in registers. */

#ifdef SINGLE
typedef float real;
#else
typedef double real;
#endif

#define CHAINS 12
#define WIDTH (64 / (int)sizeof(real))

typedef real vector __attribute__((vector_size(64)));

static real chains(long rounds, real seed) {
    vector x[CHAINS], a = {0}, b = {0}, total = {0};
    for (int j = 0; j < WIDTH; j++) { a[j] = (real)0.999; b[j] = seed; }
    for (int i = 0; i < CHAINS; i++) x[i] = b * (real)i;
    for (long k = 0; k < rounds; k++)
        for (int i = 0; i < CHAINS; i++) x[i] = x[i] * a + b;
    for (int i = 0; i < CHAINS; i++) total += x[i];
    real out = 0;
    for (int j = 0; j < WIDTH; j++) out += total[j];
    return out;
}

/* Returns the number of operations done; a fused multiply-add counts as two. */
double peak(long rounds, int threads, double seed) {
    double sum = 0;
#pragma omp parallel for num_threads(threads) reduction(+ : sum)
    for (int i = 0; i < threads; i++) sum += chains(rounds, (real)seed);
    return 2.0 * CHAINS * WIDTH * (double)rounds * threads + 0.0 * sum;
}

/* The frames of formulas.py for blocks of servos, written so that gcc vectorises the loop over the lanes of a block.
   One source, two precisions: -DREAL=double or -DREAL=float. */

#include <stdint.h>

#ifdef SINGLE
typedef float real;
typedef int32_t word;
#define MANTISSA 23
#define ROUNDER 0x1.8p23f
#define LN2_HIGH 0x1.62e4p-1f
#define LN2_LOW 0x1.7f7d1cp-20f
#define ROOT_HALF 0x3f3504f3
#else
typedef double real;
typedef int64_t word;
#define MANTISSA 52
#define ROUNDER 0x1.8p52
#define LN2_HIGH 0x1.62e42fefa38p-1
#define LN2_LOW 0x1.ef35793c7673p-45
#define ROOT_HALF 0x3fe6a09e667f3bcdLL
#endif

#define INLINE static inline __attribute__((always_inline))
#define BLOCK 128
#define R(x) ((real)(x))

typedef union { real r; word w; } bits;

INLINE real exponential(real x) {  /* x <= 0, not below the smallest normal number's logarithm */
    bits k = {R(1.4426950408889634) * x + ROUNDER};
    real n = k.r - ROUNDER;
    real r = (x - n * LN2_HIGH) - n * LN2_LOW;
#ifdef SINGLE
    real y = R(1.0 / 5040.0);
#else
    real y = R(1.0 / 479001600.0);
    y = y * r + R(1.0 / 39916800.0);
    y = y * r + R(1.0 / 3628800.0);
    y = y * r + R(1.0 / 362880.0);
    y = y * r + R(1.0 / 40320.0);
    y = y * r + R(1.0 / 5040.0);
#endif
    y = y * r + R(1.0 / 720.0);
    y = y * r + R(1.0 / 120.0);
    y = y * r + R(1.0 / 24.0);
    y = y * r + R(1.0 / 6.0);
    y = y * r + R(0.5);
    y = y * r + R(1.0);
    y = y * r + R(1.0);
    bits out = {y};
    out.w += (word)((uint64_t)k.w << MANTISSA);
    return out.r;
}

INLINE real logarithm(real x) {  /* x normal and positive */
    bits b = {x};
    word e = (b.w - ROOT_HALF) >> MANTISSA;
    b.w -= (word)((uint64_t)e << MANTISSA);
    real s = (b.r - R(1.0)) / (b.r + R(1.0));
    real z = s * s;
#ifdef SINGLE
    real y = R(2.0 / 9.0);
#else
    real y = R(2.0 / 19.0);
    y = y * z + R(2.0 / 17.0);
    y = y * z + R(2.0 / 15.0);
    y = y * z + R(2.0 / 13.0);
    y = y * z + R(2.0 / 11.0);
    y = y * z + R(2.0 / 9.0);
#endif
    y = y * z + R(2.0 / 7.0);
    y = y * z + R(2.0 / 5.0);
    y = y * z + R(2.0 / 3.0);
    y = y * z + R(2.0);
    return (real)e * LN2_HIGH + (s * y + (real)e * LN2_LOW);
}

typedef struct { real q, w; } motion;

INLINE motion phase(motion m, real f, real rate, real tau, real forward, real backward, real breakaway, real t) {
    /* Both branches of every choice are computed first: gcc then turns the choices into masks. */
    real w = m.w;
    real F = w > 0 ? forward : -backward;
    real v = (f - F) * tau;
    real turns = w * v < 0 ? R(1.0) : R(0.0);
    real ratio = w / (turns > 0 ? v : R(1.0));
    real until = logarithm(turns > 0 ? 1 - ratio : R(1.0)) * tau;
    real t_stop = turns > 0 ? until : t;
    real t_1 = t_stop < t ? t_stop : t;
    t_1 = w == 0 ? R(0.0) : t_1;
    real E = 1 - exponential(-rate * t_1);
    real slid = w + (v - w) * E;
    m.q += v * t_1 + (w - v) * E * tau;
    real stops = t_stop <= t ? turns : R(0.0);
    stops = w == 0 ? R(1.0) : stops;
    m.w = stops > 0 ? R(0.0) : slid;
    real up = f - forward, down = f + backward;
    real g = f < -breakaway * backward ? down : R(0.0);
    g = f > breakaway * forward ? up : g;
    real t_2 = t - t_1;
    v = g * stops * tau;
    E = 1 - exponential(-rate * t_2);
    m.q += v * (t_2 - E * tau);
    m.w += v * E;
    return m;
}

enum { PUSH, DRIVE_RATE, BRAKE_RATE, FORWARD, BACKWARD, BREAKAWAY, TORQUE, SLOPE, OFFSET, HALF_DEADBAND, GAIN, MINIMUM,
       COLUMNS };

#define COLUMN(k) (columns + (long)(k) * lanes + first)

/* One block through all frames. pulses: (frames, lanes); columns: (COLUMNS, lanes). */
static void block(long lanes, long first, long n, long frames, real T_f, const real *restrict columns,
                  const real *restrict pulses, real *restrict angle, real *restrict speed) {
    const real *push = COLUMN(PUSH), *drive = COLUMN(DRIVE_RATE), *brake = COLUMN(BRAKE_RATE);
    const real *forward = COLUMN(FORWARD), *backward = COLUMN(BACKWARD), *breakaway = COLUMN(BREAKAWAY);
    const real *torque = COLUMN(TORQUE), *slope = COLUMN(SLOPE), *offset = COLUMN(OFFSET);
    const real *dead = COLUMN(HALF_DEADBAND), *gain = COLUMN(GAIN), *minimum = COLUMN(MINIMUM);
    real q[BLOCK], w[BLOCK], sign[BLOCK] = {0}, left[BLOCK] = {0}, tau_d[BLOCK], tau_b[BLOCK];
    for (long i = 0; i < n; i++) { q[i] = angle[first + i]; w[i] = 0; }
    for (long i = 0; i < n; i++) { tau_d[i] = 1 / drive[i]; tau_b[i] = 1 / brake[i]; }
    for (long k = 0; k < frames; k++) {
        const real *t_in = pulses + k * lanes + first;
#pragma GCC ivdep
        for (long i = 0; i < n; i++) {
            real T_os = offset[i] + slope[i] * q[i];
            T_os = T_os > 0 ? T_os : R(0.0);
            real e = t_in[i] - T_os;
            real u = (e > 0 ? e : -e) - dead[i];
            real wanted = minimum[i] + gain[i] * u;
            real t_on = u > 0 ? wanted : R(0.0);
            real d = t_in[i] > T_os ? t_in[i] : T_os;
            real rest = T_f - d;
            real t_a = left[i] < d ? left[i] : d;
            real t_c = t_on < rest ? t_on : rest;
            real s = e > 0 ? R(1.0) : R(-1.0);
            motion m = {q[i], w[i]};
            m = phase(m, sign[i] * push[i] - torque[i], drive[i], tau_d[i], forward[i], backward[i], breakaway[i], t_a);
            m = phase(m, -torque[i], brake[i], tau_b[i], forward[i], backward[i], breakaway[i], d - t_a);
            m = phase(m, s * push[i] - torque[i], drive[i], tau_d[i], forward[i], backward[i], breakaway[i], t_c);
            m = phase(m, -torque[i], brake[i], tau_b[i], forward[i], backward[i], breakaway[i], rest - t_c);
            q[i] = m.q; w[i] = m.w; sign[i] = s;
            left[i] = t_on - t_c;
        }
    }
    for (long i = 0; i < n; i++) { angle[first + i] = q[i]; speed[first + i] = w[i]; }
}

/* `angle` holds the start and gets the end. */
void run(long lanes, long frames, double T_f, const real *columns, const real *pulses, real *angle, real *speed,
         int threads) {
#pragma omp parallel for num_threads(threads) schedule(static)
    for (long first = 0; first < lanes; first += BLOCK)
        block(lanes, first, lanes - first < BLOCK ? lanes - first : BLOCK, frames, (real)T_f, columns, pulses, angle,
              speed);
}

/* Rounding, arrays, and arithmetic as Python has it. */
#define NEAREST(x) rint(x)
#define NEARESTf(x) rintf(x)
#define FLOOR(x) floor(x)
#define FLOORf(x) floorf(x)
#define CEIL(x) ceil(x)
#define CEILf(x) ceilf(x)
#define CHECKED_SIZE(type, size) typedef char type##_has_its_size[sizeof(type) == (size) ? 1 : -1]

typedef struct { double *p; int64_t n[1]; } array_double_1;
typedef struct { double *p; int64_t n[2]; } array_double_2;
typedef struct { int64_t *p; int64_t n[1]; } array_int64_t_1;
typedef struct { int8_t *p; int64_t n[1]; } array_int8_t_1;
typedef struct { int32_t *p; int64_t n[1]; } array_int32_t_1;

/* Whole numbers are divided as Python divides them; by 0 the quotient is 0. */
SMALL int64_t floor_div(int64_t a, int64_t b) {
    if (b == 0 || b == -1)
        return b == 0 ? 0 : (int64_t)(0 - (uint64_t)a);
    return a / b - (a % b != 0 && (a < 0) != (b < 0));
}
SMALL int64_t floor_mod(int64_t a, int64_t b) {
    if (b == 0 || b == -1)
        return 0;
    const int64_t rest = a % b;
    return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}
SMALL double mod_float(double a, double b) {
    const double rest = fmod(a, b);
    if (rest == 0)
        return copysign(0.0, b);
    return (rest < 0) != (b < 0) ? rest + b : rest;
}
SMALL double floor_div_float(double a, double b) {
    const double rest = fmod(a, b);
    const double times = (a - rest) / b - (rest != 0 && (rest < 0) != (b < 0));
    const double down = floor(times);
    return times == 0 ? copysign(0.0, a / b) : times - down > 0.5 ? down + 1 : down;
}
SMALL int64_t whole_power(int64_t x, int64_t n) {
    uint64_t found = 1;
    for (int64_t k = 0; k < n; k++)
        found *= (uint64_t)x;
    return (int64_t)found;
}
/* Bits that leave a word are lost, also where all of them do. */
SMALL int64_t moved_left(int64_t x, int64_t n) {
    return n < 0 || n > 63 ? 0 : (int64_t)((uint64_t)x << n);
}
SMALL int64_t moved_right(int64_t x, int64_t n) {
    return x >> (n < 0 || n > 63 ? 63 : n);
}
/* The whole number that x is, towards zero; what none holds, nan too, is the lowest one. */
SMALL int64_t whole(double x) {
    return x >= -9223372036854775808.0 && x < 9223372036854775808.0 ? (int64_t)x : INT64_MIN;
}
SMALL int64_t clamped(int64_t k, int64_t n) {
    k += k < 0 ? n : 0;
    return k < 0 ? 0 : k > n ? n : k;
}

/* What follows is C99; the digits are those of doubles by IEEE 754, never of a product and a sum rounded at once. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif
#if defined(__GNUC__)
#define SMALL static inline __attribute__((unused))
#define INLINED static inline __attribute__((always_inline, unused))
#else
#define SMALL static inline
#define INLINED SMALL
#endif
#define PACKED
#define FMA(a, b, c) ((a) * (b) + (c))
#define FMAf(a, b, c) ((a) * (b) + (c))

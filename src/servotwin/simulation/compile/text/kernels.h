/* What kernels printed by servotwin stand on: C99, and in macros what compilers add to it. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif
#define SMALL static inline __attribute__((unused))
#ifndef INLINED  /* checks of memory leave it to the compiler */
#define INLINED static inline __attribute__((always_inline, unused))
#endif
#define ASIDE static __attribute__((noinline, unused))
#define PACKED __attribute__((packed))
#if defined(__x86_64__) && !defined(__FMA__)
/* A function that computes it exactly takes nearly twice the time of a lane. */
#define FMA(a, b, c) ((double)(a) * (double)(b) + (double)(c))
#define FMAf(a, b, c) ((float)(a) * (float)(b) + (float)(c))
#else
#define FMA(a, b, c) __builtin_fma(a, b, c)
#define FMAf(a, b, c) __builtin_fmaf(a, b, c)
#endif
#define AS_TEXT(...) #__VA_ARGS__
#define PRAGMA(...) _Pragma(AS_TEXT(__VA_ARGS__))
#if defined(__clang__)
#define SUM_IN_ANY_ORDER(...) PRAGMA(omp simd reduction(+ : __VA_ARGS__))
#else /* gcc 12 takes the freedom without becoming any quicker */
#define SUM_IN_ANY_ORDER(...)
#endif

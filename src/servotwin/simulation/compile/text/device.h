/* One text for a processor and, by clang, for a GPU, where there is no library: functions of floats are instructions. */
#if defined(__NVPTX__)
typedef signed char int8_t;
typedef unsigned char uint8_t;
typedef int int32_t;
typedef unsigned uint32_t;
typedef long long int64_t;
typedef unsigned long long uint64_t;
typedef unsigned long uintptr_t;
#define bool _Bool
#define true 1
#define false 0
#define INT64_C(x) x##LL
#define UINT64_C(x) x##ULL
#define INT64_MIN (-9223372036854775807LL - 1)
#define NULL ((void *)0)
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
#define memcpy __builtin_memcpy
#define isfinite(x) __builtin_isfinite(x)
#define isnan(x) __builtin_isnan(x)
#define isinf(x) __builtin_isinf(x)
#define sqrt __builtin_sqrt
#define sqrtf __builtin_sqrtf
#define fabs __builtin_fabs
#define fabsf __builtin_fabsf
#define llabs __builtin_llabs
#define floor __builtin_floor
#define floorf __builtin_floorf
#define ceil __builtin_ceil
#define ceilf __builtin_ceilf
#define rint __builtin_rint
#define rintf __builtin_rintf
#define copysign __builtin_copysign
#define copysignf __builtin_copysignf
double fmod(double, double); /* there is none: no text may need it */
float fmodf(float, float);
#define IN_REGISTER "+l"
#else
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define IN_REGISTER "+r"
#endif
/* A tile whose numbers have to be read now: registers are for what changes. */
#define ANEW(tile) ({ __typeof__(tile) read_anew = (tile); __asm__ volatile("" : IN_REGISTER(read_anew)); read_anew; })

/* What kernels ask of a C library, where there is none: the page gives the functions. */
#define INFINITY __builtin_inf()
#define NAN __builtin_nan("")
#define isfinite(x) __builtin_isfinite(x)
#define isnan(x) __builtin_isnan(x)
#define signbit(x) __builtin_signbit(x)
double sqrt(double), exp(double), expm1(double), log(double), log1p(double), sin(double), cos(double), tanh(double);
double atan2(double, double), atanh(double), pow(double, double), copysign(double, double), fabs(double);
double floor(double), ceil(double), rint(double), fmod(double, double);

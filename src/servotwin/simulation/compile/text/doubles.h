/* What looks at the bits of doubles. */
SMALL double float_of(int64_t word) {
    double x;
    memcpy(&x, &word, sizeof x);
    return x;
}
SMALL int64_t word_of(double x) {
    int64_t word;
    memcpy(&word, &x, sizeof word);
    return word;
}
/* 2^k for a whole k: a sum with a magic number leaves k in the lowest bits, from where it is moved to the exponent. */
INLINED double two_power(double k) {
    const double shifted = k + 6755399441055744.0;
    uint64_t bits;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 1023) << 52;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
/* x 2^k for a whole k of at most 2000, by two products. */
SMALL double scaled(double x, double k) {
    const double half = NEAREST(0.5 * k);
    return x * two_power(half) * two_power(k - half);
}
/* The whole e for which x / 2^e lies in [sqrt(1/2), sqrt(2)); with operations that AVX2 has for four numbers at once. */
INLINED double binary_exponent(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = ((bits - UINT64_C(0x3FE6A09E667F3BCD) + (UINT64_C(1023) << 52)) >> 52) | UINT64_C(0x4330000000000000);
    double e;
    memcpy(&e, &bits, sizeof e);
    return e - 4503599627371519.0;
}

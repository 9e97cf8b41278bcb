/* The same of floats. */
INLINED float two_powerf(float k) {
    const float shifted = k + 12582912.0f;
    uint32_t bits;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 127) << 23;
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
INLINED float binary_exponentf(float x) {
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (float)((bits - 0x3F3504F3) >> 23);
}
/* x 2^k for a whole k of at most 250, by two products. */
SMALL float scaledf(float x, float k) {
    const float half = NEARESTf(0.5f * k);
    return x * two_powerf(half) * two_powerf(k - half);
}

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

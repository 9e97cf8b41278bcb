/* Memory at addresses, and functions there. */
SMALL array_int64_t_1 words(int64_t address, int64_t count) {
    return (array_int64_t_1){(int64_t *)(intptr_t)address, {count}};
}
SMALL array_double_1 numbers(int64_t address, int64_t count) {
    return (array_double_1){(double *)(intptr_t)address, {count}};
}
SMALL array_double_2 rows(int64_t address, int64_t count, int64_t width) {
    return (array_double_2){(double *)(intptr_t)address, {count, width}};
}
SMALL array_int8_t_1 bytes_at(int64_t address, int64_t count) {
    return (array_int8_t_1){(int8_t *)(intptr_t)address, {count}};
}
SMALL array_int32_t_1 halves(int64_t address, int64_t count) {
    return (array_int32_t_1){(int32_t *)(intptr_t)address, {count}};
}
typedef int64_t told_1(int64_t), told_2(int64_t, int64_t), told_3(int64_t, int64_t, int64_t),
    told_4(int64_t, int64_t, int64_t, int64_t), told_5(int64_t, int64_t, int64_t, int64_t, int64_t),
    told_6(int64_t, int64_t, int64_t, int64_t, int64_t, int64_t),
    told_7(int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);
#define TOLD(kind, function, ...) (((kind *)(intptr_t)(function))(__VA_ARGS__))
SMALL void copied(int64_t to, int64_t of, int64_t size) {
    memcpy((void *)(intptr_t)to, (const void *)(intptr_t)of, (size_t)size);
}
static int64_t active_word;
SMALL void activate(int64_t word) {
    active_word = word;
}
SMALL int64_t active(void) {
    return active_word;
}

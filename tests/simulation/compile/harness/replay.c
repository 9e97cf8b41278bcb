/* Calls a kernel with arguments that were written down, and writes down its memory afterwards: natively and in wasm.

   From stdin, whole numbers of 64 bits: how many words and arrays there are, the words; for each array the place of its
   address in the words, its size in bytes and what is in it. To stdout: what is in them afterwards, and the result. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int64_t KERNEL(int64_t *words);

static void *taken(size_t size) {
    void *room = malloc(size + 64);
    if (room == NULL || fread(room, 1, size, stdin) != size)
        exit(2);
    return room;
}

int main(void) {
    int64_t *counts = taken(16);
    int64_t *words = taken((size_t)counts[0] * 8);
    void **arrays = malloc((size_t)counts[1] * sizeof *arrays);
    int64_t **heads = malloc((size_t)counts[1] * sizeof *heads);
    for (int64_t k = 0; k < counts[1]; k++) {
        heads[k] = taken(16);
        arrays[k] = taken((size_t)heads[k][1]);
        words[heads[k][0]] = (int64_t)(intptr_t)arrays[k];
    }
    int64_t result = KERNEL(words);
    for (int64_t k = 0; k < counts[1]; k++)
        fwrite(arrays[k], 1, (size_t)heads[k][1], stdout);
    fwrite(&result, 8, 1, stdout);
    return 0;
}

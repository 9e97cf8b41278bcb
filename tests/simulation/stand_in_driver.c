/* The functions of libcuda that servotwin calls, for a computer without a GPU: kernels are those of the same text, made
 * by a C compiler, and "the device" is a part of this memory. It counts what a driver would have to keep. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define NAMES 16
static struct {
    int64_t version, devices, major, minor; /* what it says it is */
    int64_t contexts, bytes, launches, registers;
} stand_in = {13000, 1, 8, 0, 0, 0, 0, 0};
static char libraries[NAMES][1024]; /* of the modules that will be loaded, in this order */
static int coming, loaded;
enum { INVALID = 1, NO_MEMORY = 2, NO_CONTEXT = 201, BAD_IMAGE = 200, NOT_FOUND = 500 };

int64_t *stand_in_state(void) { return &stand_in.version; }
void stand_in_library(const char *path) { strncpy(libraries[coming++ % NAMES], path, sizeof *libraries - 1); }

#define IN_CONTEXT if (stand_in.contexts < 1) return NO_CONTEXT /* they nest where memory is collected within a call */
int cuInit(unsigned flags) { return flags ? INVALID : 0; }
int cuDriverGetVersion(int *version) { return *version = (int)stand_in.version, 0; }
int cuDeviceGetCount(int *count) { return *count = (int)stand_in.devices, 0; }
int cuDeviceGet(int *device, int number) { return *device = number, number < stand_in.devices ? 0 : INVALID; }
int cuDeviceGetAttribute(int *value, int which, int device) {
    (void)device;
    *value = (int)(which == 75 ? stand_in.major : stand_in.minor);
    return which == 75 || which == 76 ? 0 : INVALID;
}
int cuDevicePrimaryCtxRetain(void **context, int device) { return *context = &stand_in, device; }
int cuDevicePrimaryCtxRelease_v2(int device) { return device; }
int cuCtxPushCurrent_v2(void *context) { return stand_in.contexts++, context == &stand_in ? 0 : INVALID; }
int cuCtxPopCurrent_v2(void **context) { return stand_in.contexts--, *context = &stand_in, 0; }
int cuModuleLoadDataEx(void **module, const char *image, unsigned count, const int *options, void **values) {
    IN_CONTEXT;
    for (unsigned k = 0; k < count; k++)
        if (options[k] == 0)
            stand_in.registers = (int64_t)(intptr_t)values[k];
        else if (options[k] == 5 && strstr(image, ".version 7.0") == NULL)
            strcpy(values[k], "ptxas fatal:\n no PTX of 7.0");
    if (strstr(image, ".version 7.0") == NULL)
        return BAD_IMAGE;
    *module = dlopen(libraries[loaded++ % NAMES], RTLD_NOW);
    return *module ? 0 : BAD_IMAGE;
}
int cuModuleGetFunction(void **function, void *module, const char *name) {
    IN_CONTEXT;
    *function = dlsym(module, name);
    return *function ? 0 : NOT_FOUND;
}
int cuMemAlloc_v2(void **address, size_t size) {
    IN_CONTEXT;
    int64_t *found = size ? malloc(size + 16) : NULL;
    if (found == NULL)
        return size ? NO_MEMORY : INVALID;
    memset(found, 0xA5, size + 16);
    *found = (int64_t)size;
    stand_in.bytes += *found;
    *address = found + 2;
    return 0;
}
int cuMemFree_v2(int64_t *address) {
    IN_CONTEXT;
    stand_in.bytes -= address[-2];
    free(address - 2);
    return 0;
}
int cuMemcpyHtoDAsync_v2(void *to, const void *from, size_t size, void *stream) {
    (void)stream;
    IN_CONTEXT;
    return memcpy(to, from, size), 0;
}
int cuMemcpyDtoHAsync_v2(void *to, const void *from, size_t size, void *stream) {
    return cuMemcpyHtoDAsync_v2(to, from, size, stream);
}
int cuMemsetD8Async(void *to, unsigned char value, size_t size, void *stream) {
    (void)stream;
    IN_CONTEXT;
    return memset(to, value, size), 0;
}
int cuStreamSynchronize(void *stream) { IN_CONTEXT; return stream == (void *)-1 ? INVALID : 0; }
int cuEventCreate(void **event, unsigned flags) { IN_CONTEXT; return *event = &stand_in, flags == 2 ? 0 : INVALID; }
int cuEventRecord(void *event, void *stream) { (void)stream; IN_CONTEXT; return event == &stand_in ? 0 : INVALID; }
int cuStreamWaitEvent(void *stream, void *event, unsigned flags) { (void)flags; return cuEventRecord(event, stream); }
int cuEventDestroy_v2(void *event) { IN_CONTEXT; return event == &stand_in ? 0 : INVALID; }
int cuLaunchKernel(void (*function)(const void *, int64_t, int64_t), unsigned x, unsigned y, unsigned z, unsigned threads,
                   unsigned ys, unsigned zs, unsigned shared, void *stream, void **arguments, void **extra) {
    (void)stream;
    IN_CONTEXT;
    if (y != 1 || z != 1 || ys != 1 || zs != 1 || shared || extra || x == 0 || threads == 0 || threads > 1024)
        return INVALID;
    const int64_t lanes = *(const int64_t *)arguments[0], grid = (int64_t)x * threads;
    stand_in.launches++;
    function(arguments[0], 0, grid < lanes ? grid : lanes);
    return 0;
}
int cuGetErrorString(int code, const char **text) {
    *text = code == NO_MEMORY ? "out of memory" : code == BAD_IMAGE ? "device kernel image is invalid" : "invalid argument";
    return 0;
}

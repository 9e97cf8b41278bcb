/* Events and commands on their way between the harness and its host. The harness ends when the host does: its pipe is
 * closed then, or where another process still holds that, it has become somebody else's child. */
#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#define EVENTS 3   /* descriptor; libraries may print on 1 */
#define ROOM 65536 /* bytes */
#define HEAD 12

static uint8_t out[ROOM], told[4096];
static size_t filled, said;
static uint64_t said_at;

static void flush(void) {
    size_t done = 0;
    while (done < filled) {
        ssize_t n = write(EVENTS, out + done, filled - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) _exit(0); /* nobody listens any more */
        done += (size_t)n;
    }
    filled = 0;
}

static void event(uint64_t cycle, char kind, uint8_t a, uint16_t b, const uint8_t *bytes, size_t length) {
    if (filled + HEAD + length > ROOM) flush();
    memcpy(out + filled, &cycle, 8);
    out[filled + 8] = (uint8_t)kind;
    out[filled + 9] = a;
    memcpy(out + filled + 10, &b, 2);
    if (length) memcpy(out + filled + HEAD, bytes, length);
    filled += HEAD + length;
}

static void tell_wire(void) {
    if (said) event(said_at, 'T', 0, (uint16_t)said, told, said);
    said = 0;
}

static uint8_t in[4096];
static size_t held, taken;
static pid_t parent;

static uint8_t next_byte(void) {
    while (taken == held) {
        struct pollfd wait = {.fd = 0, .events = POLLIN};
        int ready = poll(&wait, 1, 1000);
        if (ready == 0 && getppid() != parent) _exit(0); /* another process may still hold the pipe */
        if (ready <= 0) continue;
        ssize_t n = read(0, in, sizeof in);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) _exit(0);
        held = (size_t)n;
        taken = 0;
    }
    return in[taken++];
}

static uint64_t number(int bytes) {
    uint64_t value = 0;
    for (int k = 0; k < bytes; k++) value |= (uint64_t)next_byte() << 8 * k;
    return value;
}

static void open_pipes(void) {
    parent = getppid();
    dup2(1, EVENTS);
    dup2(2, 1);
}

/* Starts a program on a Cortex-M4 whose output goes to a debugger (semihosting), and ends there with what it returns. */
#include <stdio.h>
#include <string.h>

extern char data_from[], data_start[], data_end[], bss_start[], bss_end[], stack_top[];
void initialise_monitor_handles(void);
void _exit(int);
int main(void);
void reset(void);

void reset(void) {
#ifdef __ARM_FP
    *(volatile unsigned long *)0xE000ED88 |= 0xFul << 20; /* its instructions for floats are off at first */
#endif
    memcpy(data_start, data_from, (size_t)(data_end - data_start));
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    initialise_monitor_handles();
    const int code = main();
    fflush(stdout);
    _exit(code);
}

static void fault(void) {
    _exit(99);
}

typedef union {
    void *stack;
    void (*handler)(void);
} vector;
__attribute__((section(".vectors"), used)) static const vector vectors[7] = {
    {stack_top}, {.handler = reset}, {.handler = fault}, {.handler = fault}, {.handler = fault}, {.handler = fault},
    {.handler = fault}};

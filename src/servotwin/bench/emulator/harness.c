/* An ATmega328P at 16 MHz under libsimavr, in lockstep with a host that has the servo: commands come by stdin, events go
 * by stdout. Compiled on the user's machine, against the user's libsimavr (GPL), when it is needed first:
 *
 *     cc -O2 -o harness harness.c -lsimavr -lelf        harness firmware.hex
 *
 * Numbers are little-endian. Commands, each a letter and its arguments:
 *     g until u64              go on to this cycle; ends with an event h
 *     v number u8, counts u16  answer to an event A: what the converter finds at each of its instants
 *     w length u16, bytes      onto the wire to the board, one after the other as fast as it carries them
 *     p address u16, value u8  poke into registers or SRAM
 *     m address u16, count u8  look at registers or SRAM; answered by an event m
 *     d port u8, bit u8, level u8   pull a pin to a level from outside
 * Events, each cycle u64, kind u8, a u8, b u16, then b bytes where it says so:
 *     P level                  the pulse's pin has changed
 *     L level                  the light's pin has changed
 *     D rs << 4 | nibble       half a byte to the display, as E falls
 *     A reference, bytes       a voltage is held; the host owes counts, by the end of the conversion: the one of now and
 *                              those that are foreseen, as cycle u64, channel u8 each
 *     T, bytes                 from the board onto the wire
 *     O                        a byte to the board was lost: three wait unread, which is what the chip has room for
 *     m, bytes                 what a look has found
 *     R                        the board has been reset by itself
 *     h                        there we are
 *     x                        the program has crashed, or sleeps for ever
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_hex.h>

#include "foresight.h"
#include "pipes.h"

#define FREQUENCY 16000000
#define RESOLUTION 1023  /* the converter of simavr multiplies by this and divides by the reference [mV] */
#define INTERNAL 1100    /* mV: the one reference of simavr that is not ours to choose */
#define DDRB 0x24
#define PORTB 0x25
#define UBRRL 0xC4
#define UBRRH 0xC5
#define UCSRA 0xC0
#define ADMUX 0x7C
#define ADCSRA 0x7A
#define ADEN 7
#define PULSE 1          /* bits of port B */
#define LIGHT 5
#define DISPLAY_E 0x08   /* of port D */
#define DISPLAY_RS 0x04
#define BITS_OF_BYTE 10  /* 8N1 */
#define UNREAD 3         /* bytes that the chip has room for, the one in its shift register too */
#define QUEUE 65536       /* bytes on their way to the board, a power of two */

static avr_t *avr;
static avr_uart_t *uart;
static avr_adc_t *adc;
static avr_timer_t *timer1;
static avr_irq_t *port_b;

static int running, owed, channel, levels[8];
static uint64_t converter_on; /* cycle; its clock counts from there */
static avr_cycle_count_t waits;
static uint16_t count;
static uint8_t display;
static void (*chip_reset)(avr_t *);

/* the wire to the board: a byte begins as the one before ends */

static uint8_t coming[QUEUE];
static size_t first, last;

static void eight_bits(void) {
    uint32_t bit = (uint32_t)(avr->data[UBRRL] + 256 * (avr->data[UBRRH] & 15) + 1) * (avr->data[UCSRA] & 2 ? 8 : 16);
    if (uart->cycles_per_byte == (BITS_OF_BYTE + 1) * bit) uart->cycles_per_byte = BITS_OF_BYTE * bit;
} /* simavr 1.6 counts a parity bit that is not there */

static avr_cycle_count_t feed(avr_t *a, avr_cycle_count_t when, void *unused) {
    (void)a, (void)unused;
    if (first == last) return 0;
    eight_bits();
    unsigned waiting = (unsigned)(uart->input.write - uart->input.read + 64) % 64;
    uint8_t byte = coming[first++ % QUEUE];
    if (waiting >= UNREAD) event(when, 'O', 0, 0, NULL, 0);
    else avr_raise_irq(uart->io.irq + UART_IRQ_INPUT, byte);
    return when + uart->cycles_per_byte;
}

static void to_board(void) {
    int idle = first == last;
    size_t length = number(2);
    while (length--) {
        uint8_t byte = next_byte();
        if (last - first < QUEUE) coming[last++ % QUEUE] = byte;
    }
    if (idle && first != last) avr_cycle_timer_register(avr, 1, feed, NULL);
}

static void from_board(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    eight_bits();
    if (said == sizeof told) tell_wire();
    if (!said) said_at = avr->cycle;
    told[said++] = (uint8_t)value;
}

/* pins */

static void set(int bit, int level, uint64_t cycle) {
    if (levels[bit] == level) return;
    levels[bit] = level;
    if (bit == PULSE) forget(); /* what the servo does from here on is another thing */
    event(cycle, bit == PULSE ? 'P' : 'L', (uint8_t)level, 0, NULL, 0);
}

static uint64_t of_compare(void) { /* the very cycle of a match, where simavr has ended an instruction since */
    uint64_t match = timer1->tov_base + timer1->comp[0].comp_cycles;
    return match <= avr->cycle && avr->cycle - match < 8 ? match : avr->cycle;
}

static void on_pin(avr_irq_t *irq, uint32_t value, void *bit) {
    (void)irq;
    int k = (int)(intptr_t)bit;
    set(k, value && avr->data[DDRB] >> k & 1, k == PULSE ? of_compare() : avr->cycle);
}

static void on_direction(avr_irq_t *irq, uint32_t directions, void *unused) {
    (void)irq, (void)unused;
    for (int k = PULSE; k <= LIGHT; k += LIGHT - PULSE)
        set(k, directions >> k & avr->data[PORTB] >> k & 1, avr->cycle);
}

static void on_display(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    if (display & DISPLAY_E && !(value & DISPLAY_E))
        event(avr->cycle, 'D', (uint8_t)((value & DISPLAY_RS ? 16 : 0) | value >> 4), 0, NULL, 0);
    display = (uint8_t)value;
}

/* the converter: asked as the voltage is held, told as the conversion ends, and not waited for in between */

static void obey(void);

static uint64_t next_match(void) {
    uint64_t match = timer1->tov_base + timer1->comp[0].comp_cycles;
    return match > avr->cycle ? match : match + timer1->tov_cycles;
}

static avr_cycle_count_t on_hold(avr_t *a, avr_cycle_count_t when, void *unused) {
    (void)a, (void)unused;
    struct asked now = {when, (uint8_t)channel, avr->data[ADMUX] >> 6};
    if (is_foreseen(now, &count)) return 0;
    uint8_t list[9 * AHEAD];
    unsigned n = foresee(next_match());
    for (unsigned k = 0; k < n; k++) {
        memcpy(list + 9 * k, &foreseen[k].cycle, 8);
        list[9 * k + 8] = foreseen[k].channel;
    }
    event(when, 'A', now.reference, (uint16_t)(9 * n), list, 9 * n);
    flush();
    owed = 1;
    return 0;
}

static void take_counts(void) {
    unsigned n = (unsigned)number(1);
    for (unsigned k = 0; k < n && k < AHEAD; k++) answers[k] = (uint16_t)number(2);
    count = answers[0];
    owed = 0;
}

static avr_cycle_count_t on_end(avr_t *a, avr_cycle_count_t when, void *unused) {
    (void)a, (void)when, (void)unused;
    while (owed) obey();
    uint32_t value = count;
    if (avr->data[ADMUX] >> 6 == 3) value = (value * INTERNAL + RESOLUTION - 1) / RESOLUTION;
    for (int k = 0; k < 8; k++) adc->adc_values[k] = (uint16_t)value; /* whatever channel is chosen next */
    return 0;
}

static void on_power(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)unused;
    if (value && !irq->value) converter_on = avr->cycle;
}

static avr_cycle_count_t later(avr_t *a, avr_cycle_count_t when, void *unused) { /* simavr knows no clock to wait for */
    (void)unused;
    for (avr_cycle_timer_slot_p t = a->cycle_timers.timer; t; t = t->next) {
        if (t->param != adc) continue;
        avr_cycle_timer_register(a, t->when + waits - a->cycle, t->timer, adc);
        break;
    }
    (void)when;
    return 0;
}

static void on_trigger(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    union { avr_adc_mux_t mux; uint32_t value; } asked = {.value = value};
    if (asked.mux.kind != ADC_MUX_SINGLE) return;
    channel = asked.mux.src;
    uint8_t shift = avr->data[adc->r_adcsra] & 7;
    uint32_t clock = 1u << (shift ? shift : 1); /* data sheet, 24.4: begins with the next one of these */
    waits = clock - (avr->cycle - converter_on) % clock;
    avr_cycle_timer_register(avr, waits + (adc->first ? 27 : 3) * clock / 2, on_hold, NULL); /* table 24-1 */
    avr_cycle_timer_register(avr, waits + (adc->first ? 25 : 13) * clock - 1, on_end, NULL);
    avr_cycle_timer_register(avr, 1, later, NULL);
}

/* the board */

static void on_reset(avr_t *a) {
    chip_reset(a);
    for (int k = 0; k < 8; k++) port_b[k].value = 0;
    set(PULSE, 0, avr->cycle);
    set(LIGHT, 0, avr->cycle);
    first = last;
    owed = 0;
    forget();
    event(avr->cycle, 'R', 0, 0, NULL, 0);
    if (running) running = 2; /* the timer that stops us is gone */
}

static avr_cycle_count_t stop(avr_t *a, avr_cycle_count_t when, void *unused) {
    (void)a, (void)when, (void)unused;
    running = 0;
    return 0;
}

static void no_polling(void) { /* simavr asks the display's lines, low inputs of interrupts, at each cycle: it is asleep */
    for (uint8_t k = 0; k < 2; k++) avr_extint_set_strict_lvl_trig(avr, k, 0);
}

static void rest(avr_t *a, avr_cycle_count_t cycles) { (void)a, (void)cycles; } /* no time on the wall */

static void quiet(avr_t *a, const int level, const char *format, va_list values) {
    (void)a;
    if (level == LOG_ERROR) vfprintf(stderr, format, values);
}

static void go(void) {
    uint64_t until = number(8);
    if (until > avr->cycle) {
        avr_cycle_timer_register(avr, until - avr->cycle, stop, NULL);
        running = 1;
        while (running) {
            int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed) {
                event(avr->cycle, 'x', (uint8_t)state, 0, NULL, 0);
                flush();
                _exit(1);
            }
            if (running == 2) {
                running = 1;
                no_polling();
                avr_cycle_timer_register(avr, until > avr->cycle ? until - avr->cycle : 1, stop, NULL);
            }
        }
    }
    tell_wire();
    event(avr->cycle, 'h', 0, 0, NULL, 0);
    flush();
}

static void obey(void) {
    switch (next_byte()) {
    case 'g': go(); break;
    case 'v': take_counts(); break;
    case 'w': to_board(); break;
    case 'p': {
        uint64_t address = number(2), value = number(1);
        if (address <= avr->ramend) avr->data[address] = (uint8_t)value;
        break;
    }
    case 'm': {
        uint64_t address = number(2), bytes = number(1);
        if (address + bytes > avr->ramend + 1u) bytes = 0;
        event(avr->cycle, 'm', 0, (uint16_t)bytes, avr->data + address, bytes);
        flush();
        break;
    }
    case 'd': {
        char name = (char)number(1);
        unsigned bit = (unsigned)number(1), level = (unsigned)number(1);
        avr_ioport_external_t pull = {.name = (unsigned char)name, .mask = 1u << bit, .value = level << bit};
        avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(name), &pull);
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(name), (int)bit), level);
        break;
    }
    default: fprintf(stderr, "harness: no such command\n"); _exit(2);
    }
}

static void *part(const char *kind, char name) { /* the chip's own record of one of its parts */
    for (avr_io_t *io = avr->io_port; io; io = io->next) {
        if (strcmp(io->kind, kind)) continue;
        if (!name || ((avr_timer_t *)io)->name == name) return io;
    }
    fprintf(stderr, "harness: this chip has no %s\n", kind);
    _exit(2);
}

int main(int argc, char **argv) {
    open_pipes();
    if (argc != 2) {
        fprintf(stderr, "harness: give a hex file\n");
        return 2;
    }
    avr_global_logger_set(quiet);
    uint32_t size = 0, start = 0;
    uint8_t *code = read_ihex_file(argv[1], &size, &start);
    avr = avr_make_mcu_by_name("atmega328p");
    if (!code || !size || !avr) {
        fprintf(stderr, "harness: %s is no hex file\n", argv[1]);
        return 2;
    }
    avr_init(avr);
    if (start + size > avr->flashend + 1) {
        fprintf(stderr, "harness: %s is too large\n", argv[1]);
        return 2;
    }
    avr->frequency = FREQUENCY;
    avr->sleep = rest;
    avr->vcc = avr->avcc = avr->aref = RESOLUTION; /* so that millivolts are counts, all of them exact */
    avr_loadcode(avr, code, size, start);
    avr->codeend = start + size;
    no_polling();
    uart = part("uart", 0);
    adc = part("adc", 0);
    timer1 = part("timer", '1');
    uart->flags = 0;
    port_b = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0);
    avr_irq_t *port_d = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 0);
    avr_irq_register_notify(port_b + PULSE, on_pin, (void *)(intptr_t)PULSE);
    avr_irq_register_notify(port_b + LIGHT, on_pin, (void *)(intptr_t)LIGHT);
    avr_irq_register_notify(port_b + IOPORT_IRQ_DIRECTION_ALL, on_direction, NULL);
    avr_irq_register_notify(port_d + IOPORT_IRQ_REG_PORT, on_display, NULL);
    avr_irq_register_notify(uart->io.irq + UART_IRQ_OUTPUT, from_board, NULL);
    avr_irq_register_notify(adc->io.irq + ADC_IRQ_OUT_TRIGGER, on_trigger, NULL);
    avr_irq_register_notify(avr_iomem_getirq(avr, ADCSRA, NULL, ADEN), on_power, NULL);
    chip_reset = avr->reset;
    avr->reset = on_reset;
    for (;;) obey();
}

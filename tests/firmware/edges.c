// Run the firmware in simavr by a script and write down what its pins do: edges FIRMWARE.hex SCRIPT LOG SECONDS.
// The script has lines "wire CYCLE HEX", "adc CYCLE CHANNEL MILLIVOLT" and "jumper", sorted by cycle. The log has
// "P cycle level" (pulse; the cycle of Timer1's match), "L cycle level" (light), "D cycle rs nibble" (display),
// "U cycle hex" (what the board sent, up to a byte 0; the cycle of that byte).
#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_hex.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CYCLES_PER_BYTE 320  // 500 kbit/s, 10 bits
#define TOKEN 65536

static avr_t *avr;
static FILE *script, *log_file;
static avr_irq_t *wire_in, *analog;
static avr_timer_t *timer1;
static char bytes[TOKEN];    // of a "wire" line, in hex
static char *next_byte;      // in there, NULL: none
static uint64_t worst;

static void quiet(avr_t *a, const int level, const char *format, va_list arguments) {
  if (level <= LOG_ERROR) vfprintf(stderr, format, arguments);
}

static avr_cycle_count_t feed(avr_t *a, avr_cycle_count_t when, void *unused);

static avr_cycle_count_t feed_byte(avr_t *a, avr_cycle_count_t when, void *unused) {
  unsigned byte;
  if (sscanf(next_byte, "%2x", &byte) == 1) {
    avr_raise_irq(wire_in, byte);
    next_byte += 2;
    return when + CYCLES_PER_BYTE;
  }
  next_byte = NULL;
  feed(a, when, unused);
  return 0;
}

// Do all that is due, and come back for the next line.
static avr_cycle_count_t feed(avr_t *a, avr_cycle_count_t when, void *unused) {
  static char word[16];
  static unsigned long long at;
  for (;;) {
    if (!word[0] && fscanf(script, "%15s %llu", word, &at) != 2) return 0;
    if (at > a->cycle) {
      avr_cycle_timer_register(a, at - a->cycle, feed, NULL);
      return 0;
    }
    if (!strcmp(word, "adc")) {
      unsigned channel, millivolt;
      if (fscanf(script, "%u %u", &channel, &millivolt) == 2) avr_raise_irq(analog + channel, millivolt);
    } else if (fscanf(script, "%65535s", bytes) == 1) {
      word[0] = 0;
      next_byte = bytes;
      avr_cycle_timer_register(a, 1, feed_byte, NULL);
      return 0;
    }
    word[0] = 0;
  }
}

static void on_pulse(struct avr_irq_t *irq, uint32_t level, void *unused) {
  static int before = -1;
  level &= 1;
  if ((int)level == before) return;
  before = (int)level;
  // An instruction is one piece to the simulator, so the pin follows the timer up to some cycles late
  uint64_t match = timer1->tov_base + timer1->comp[AVR_TIMER_COMPA].comp_cycles;
  if (!timer1->comp[AVR_TIMER_COMPA].comp_cycles) match = avr->cycle;  // not the timer: set by hand
  if (match > avr->cycle) match -= timer1->tov_cycles;  // the timer has just begun again
  if (avr->cycle - match > worst) worst = avr->cycle - match;
  fprintf(log_file, "P %llu %u\n", (unsigned long long)match, level);
}

static void on_light(struct avr_irq_t *irq, uint32_t level, void *unused) {
  fprintf(log_file, "L %llu %u\n", (unsigned long long)avr->cycle, level & 1);
}

static void on_port_d(struct avr_irq_t *irq, uint32_t port, void *unused) {
  static uint32_t before;
  if ((before & 8) && !(port & 8))  // E falls
    fprintf(log_file, "D %llu %u %x\n", (unsigned long long)avr->cycle, (port >> 2) & 1, (port >> 4) & 15);
  before = port;
}

static void on_wire(struct avr_irq_t *irq, uint32_t byte, void *unused) {
  static char line[1024];
  static int n;
  if (byte) {
    if (n < 1000) n += sprintf(line + n, "%02x", byte & 0xFF);
    return;
  }
  if (n) fprintf(log_file, "U %llu %s\n", (unsigned long long)avr->cycle, line);
  n = 0;
}

static void no_wait(avr_t *a, avr_cycle_count_t cycles) {}

int main(int argc, char **argv) {
  if (argc != 5) return 2;
  avr_global_logger_set(quiet);
  avr = avr_make_mcu_by_name("atmega328p");
  avr_init(avr);
  avr->log = LOG_ERROR;
  avr->frequency = 16000000;
  avr->vcc = avr->avcc = 5000;
  avr->aref = 2500;
  avr->sleep = no_wait;
  ihex_chunk_p chunks = NULL;
  int n = read_ihex_chunks(argv[1], &chunks);
  if (n <= 0) return 3;
  for (int k = 0; k < n; k++) memcpy(avr->flash + chunks[k].baseaddr, chunks[k].data, chunks[k].size);
  avr->pc = 0;
  avr->codeend = avr->flashend;

  script = fopen(argv[2], "r");
  log_file = fopen(argv[3], "w");
  if (!script || !log_file) return 4;
  for (avr_io_t *io = avr->io_port; io; io = io->next)
    if (!strcmp(io->kind, "timer") && ((avr_timer_t *)io)->name == '1') timer1 = (avr_timer_t *)io;
  analog = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, 0);
  wire_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
  uint32_t flags = 0;  // no echo to stdout, no waiting
  avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_wire, NULL);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1), on_pulse, NULL);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 5), on_light, NULL);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), IOPORT_IRQ_PIN_ALL), on_port_d, NULL);
  int first = fgetc(script);
  avr_ioport_external_t pull = {.name = 'B', .mask = 1, .value = first != 'j'};  // 'j': the jumper is set
  avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('B'), &pull);
  feed(avr, 0, NULL);

  uint64_t end = (uint64_t)(16e6 * atof(argv[4]));
  int state = cpu_Running;
  while (avr->cycle < end && state != cpu_Done && state != cpu_Crashed) state = avr_run(avr);
  fclose(log_file);
  printf("state %d, the pin at most %llu cycles behind the timer\n", state, (unsigned long long)worst);
  return state == cpu_Done || state == cpu_Crashed;
}

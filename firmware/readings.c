// Whole numbers only, each rounded to nearest; README.md has the formulas for whoever wants to compute them again.
#include "readings.h"
#include <util/atomic.h>
#include "adc.h"
#include "board.h"
#include "paper.h"
#include "pulse.h"

#define UNKNOWN 0xFFFFu
#define COLDEST 100  // degrees below zero that a division rounds down from, as C would round up there

static uint16_t latest(uint8_t channel) {
  uint16_t count;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) count = adc_known & _BV(channel) ? adc_latest[channel] : UNKNOWN;
  return count;
}

// 2.5 V over 1024 counts, zero 0.82 counts low; half a count more is the middle of what gives this count.
static uint16_t paper_command_mv(uint16_t count) { return (100000ul * count + 132000ul + 20480ul) / 40960ul; }

// The paper's line, ADC_o = 432.65 V_o - 44.1.
static uint16_t paper_feedback_mv(uint16_t count) { return (100000ul * count + 4410000ul + 21632ul) / 43265ul; }

static uint16_t plain_mv(uint16_t count, uint8_t reference) {
  static const uint16_t full[REFERENCE_COUNT] = {
    [REFERENCE_EXTERNAL] = 2500, [REFERENCE_SUPPLY] = 5000, [REFERENCE_INTERNAL] = 1100};
  return ((uint32_t)count * full[reference] + 512) / 1024;
}

// The paper's line, V_o = 7.324 mV/deg q + 587.8 mV.
static int16_t degrees(uint16_t mv) {
  return (int16_t)((1000l * mv - 587800l + 3662l + 7324l * COLDEST) / 7324l) - COLDEST;
}

// A number to the right of a field; where it is too long its first digits are missing.
static char *put_number(char *at, int16_t number, uint8_t places) {
  uint16_t rest = number < 0 ? -number : number;
  uint8_t k = places;
  do {
    at[--k] = '0' + rest % 10;
    rest /= 10;
  } while (rest && k);
  if (number < 0 && k) at[--k] = '-';
  while (k) at[--k] = ' ';
  return at + places;
}

static char *put_text(char *at, const char *text) {
  while (*text) *at++ = *text++;
  return at;
}

static char *put_volts(char *at, uint16_t mv) {
  *at++ = '0' + mv / 1000;
  *at++ = '.';
  put_number(at, 1000 + mv % 1000, 3);  // all three places, the leading digit is cut
  return at + 3;
}

void readings_text(char text[2 * LINE], uint8_t mode, uint8_t reference) {
  uint16_t command = latest(CHANNEL_COMMAND), tap = latest(CHANNEL_TAP), width, period;
  uint8_t paper = mode == MODE_PAPER;
  pulse_now(&width, &period);
  if (paper) width = command == UNKNOWN ? 0 : paper_width(command);  // what belongs to the count beside it

  char *at = text;
  if (command == UNKNOWN) at = put_text(at, "-.--- ---");
  else at = put_number(put_volts(at, paper ? paper_command_mv(command) : plain_mv(command, reference)), command, 4);
  *at++ = ' ';
  at = put_text(put_number(at, (width + 1) / 2, 4), "us");

  uint16_t mv = 0;
  if (tap == UNKNOWN) at = put_text(at, "-.--- ---");
  else {
    mv = paper ? paper_feedback_mv(tap) : plain_mv(tap, reference);
    at = put_number(put_volts(at, mv), tap, 4);
  }
  at = put_number(at, period ? (2000000ul + period / 2) / period : 0, 3);
  if (tap == UNKNOWN) put_text(at, " ---");
  else put_number(at, degrees(mv), 4);
}

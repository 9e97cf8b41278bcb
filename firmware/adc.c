#include "adc.h"
#include <avr/interrupt.h>
#include <util/atomic.h>
#include "board.h"

#define SCANS 16u  // a power of two; 16 ms of rate "fast", longer than the main loop ever takes
#define PRESCALER (_BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0))  // 128: 125 kHz

static struct scan scans[SCANS];
static volatile uint8_t head, tail;
static uint8_t order[CHANNEL_COUNT], channels, reference_bits;
static volatile uint8_t at, busy, void_scan;
static volatile uint8_t lost;
volatile uint16_t adc_latest[CHANNEL_COUNT];
volatile uint8_t adc_known;

static void convert(uint8_t channel) {
  ADMUX = reference_bits | channel;
  ADCSRA = _BV(ADEN) | _BV(ADSC) | _BV(ADIE) | PRESCALER;
}

void adc_start(void) {
  DIDR0 = 0x0F;  // the pins are analog only
  ADCSRA = _BV(ADEN) | PRESCALER;
}

void adc_configure(uint8_t mask, uint8_t more, uint8_t reference) {
  static const uint8_t bits[REFERENCE_COUNT] = {
    [REFERENCE_EXTERNAL] = 0, [REFERENCE_SUPPLY] = _BV(REFS0), [REFERENCE_INTERNAL] = _BV(REFS1) | _BV(REFS0)};
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    channels = 0;
    for (uint8_t k = 0; k < CHANNEL_COUNT; k++) if (mask & _BV(k)) order[channels++] = k;
    for (uint8_t k = 0; k < CHANNEL_COUNT; k++) if (more & ~mask & _BV(k)) order[channels++] = k;
    reference_bits = bits[reference];
    if (!busy) ADMUX = reference_bits;
    tail = head;
    adc_known = 0;
    lost = 0;
    void_scan = busy;  // the conversion under way is of what was asked before
  }
}

uint8_t adc_scan(uint32_t time) {
  if (!channels || void_scan) return 0;
  if (busy || (uint8_t)(head - tail) == SCANS) {
    lost++;
    return 0;
  }
  busy = 1;
  at = 0;
  convert(order[0]);
  scans[head % SCANS].time = time;
  return 1;
}

ISR(ADC_vect) {
  uint16_t count = ADC;  // before the next channel is chosen
  if (void_scan) {
    void_scan = busy = 0;
    return;
  }
  uint8_t channel = order[at], next = at + 1;
  if (next < channels) convert(order[next]);
  scans[head % SCANS].counts[at] = count;
  adc_latest[channel] = count;
  adc_known |= _BV(channel);
  at = next;
  if (next >= channels) {
    busy = 0;
    head++;
  }
}

uint8_t adc_take(struct scan *scan) {
  uint8_t place = tail;
  if (place == head) return 0;
  barrier();
  *scan = scans[place % SCANS];
  barrier();
  tail = place + 1;
  return 1;
}

uint8_t adc_lost(void) {
  uint8_t was;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    was = lost;
    lost = 0;
  }
  return was;
}

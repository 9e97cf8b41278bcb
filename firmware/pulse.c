// Timer1 counts 0.5 us and toggles OC1A where OCR1A matches; the interrupt of one edge loads the next. So an edge is
// exact however busy the processor is, as long as it comes to load OCR1A within the time between two edges. COM1A is
// never written again: a pulse that is not wanted has no match, because OCR1A is pushed away from the counter each
// millisecond by the interrupt of OCR1B, which also arms the next rising edge.
#include "pulse.h"
#include <avr/interrupt.h>
#include <util/atomic.h>
#include "adc.h"
#include "board.h"
#include "paper.h"

#define EDGES 8u       // a power of two; 24 ms at 333 Hz
#define NEAR 3000u     // ticks; an edge is armed from here on, with at least one scan_period left: > scan_period
#define SOON 2500u     // ticks from an order to the first edge
#define FAR 0x8000u    // ticks; where no match can be before the next push
#define LEAST 3u       // ticks that a match must lie ahead of the counter to be met for sure
#ifndef START
#define START 0        // of the time, in overflows of Timer1; a test lets it wrap soon
#endif
#define CLOSE 8u       // ticks around a match in which OCR1B is not written
#define LIMIT 60000u   // a distance that is larger lies in the past: > period_max

#define ORIGIN ((uint32_t)(START) << 16)

enum { LOW, ARMED, HIGH };  // the pin: low without a match to come, low with one, high

static uint8_t pin, mode, rate;
static uint8_t running;            // frames follow one another
static uint8_t prepared;           // it is decided what the next frame is: width, period, event
static uint32_t next_rise = ORIGIN; // of the next frame; at rest the earliest time for one
static uint16_t width, period;
static uint8_t event;
static uint16_t shown_width, shown_period;
static struct point steady;        // what goes on where nothing else is said; of `frames` what is left of a point
static uint8_t playing;
static uint32_t total, played, frames;
static uint16_t overflows = START, late, silence_left;
static uint32_t tick = ORIGIN + SCAN_PERIOD;  // the next one of the 1 kHz grid
static struct edge edges[EDGES];
static volatile uint8_t head, tail, lost;

// With interrupts off.
static uint32_t now(void) {
  uint16_t low = TCNT1, high = overflows;
  if ((TIFR1 & _BV(TOV1)) && low < 0x8000u) high++;  // its interrupt waits
  return (uint32_t)high << 16 | low;
}

uint32_t pulse_time(void) {
  uint32_t time;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) time = now();
  return time;
}

static void push(uint32_t time, uint8_t what, uint8_t scanned, uint16_t w, uint16_t p) {
  if ((uint8_t)(head - tail) == EDGES) {
    lost++;
    return;
  }
  edges[head % EDGES] = (struct edge){time, w, p, what, scanned};
  head++;
}

static void leave_queue(void) {
  playing = 0;
  light(0);
}

// No pulses after the one under way.
static void rest(void) {
  running = 0;
  leave_queue();
  queue_clear();
  if (pin == HIGH) return;
  if (pin == ARMED) {
    if ((int16_t)(OCR1A - TCNT1) <= (int16_t)LEAST) return;  // too late: the pulse has begun
    OCR1A = TCNT1 + FAR;
    pin = LOW;
  }
  prepared = 0;
}

static void run(void) {
  if (running) return;
  running = 1;
  uint32_t first = now() + SOON;
  if ((int32_t)(next_rise - first) < 0) next_rise = first;
}

// Take the next point of the queue where the last one is done; say what begins or ends with the next frame.
static void advance_queue(void) {
  if (steady.frames == 0) {
    if (played == total) {
      event = EVENT_ENDED;
      queue_clear();
    } else if (!queue_take(&steady)) {
      event = EVENT_STARVED;
    } else if (played++ == 0) {
      event = EVENT_STARTED;
    }
    if (event == EVENT_ENDED || event == EVENT_STARVED) {
      playing = 0;
      return;
    }
  }
  steady.frames--;
}

// Decide what the next frame is, and arm its edge.
static void prepare(void) {
  uint16_t ahead = (uint16_t)next_rise - TCNT1;
  if (ahead < LEAST || ahead > LIMIT) {
    next_rise = now() + 2 * LEAST;
    late++;
  }
  event = 0;
  if (playing) advance_queue();
  if (mode == MODE_PAPER && adc_known & _BV(CHANNEL_COMMAND)) steady.width = paper_width(adc_latest[CHANNEL_COMMAND]);
  width = steady.width;
  period = steady.period;
  prepared = 1;
  if (width) {
    OCR1A = (uint16_t)next_rise;
    pin = ARMED;
  }
}

static void frame_begins(void) {
  uint8_t scanned = 0;
  if (rate != RATE_FAST && (rate == RATE_FRAME || mode == MODE_PAPER)) scanned = adc_scan(next_rise);
  if (rate != RATE_OFF || event) push(next_rise, event, scanned && rate == RATE_FRAME, width, period);
  if (event) light(playing);
  shown_width = width;
  shown_period = period;
  next_rise += period;
  prepared = 0;
}

ISR(TIMER1_COMPA_vect) {
  if (pin == ARMED) {
    uint16_t fall = OCR1A + width;
    if ((int16_t)(fall - TCNT1) < (int16_t)LEAST) {
      fall = TCNT1 + LEAST;
      late++;
    }
    OCR1A = fall;
    pin = HIGH;
    frames++;
    frame_begins();
  } else {
    OCR1A = TCNT1 + FAR;
    pin = LOW;
  }
}

static void every_millisecond(void) {
  if (rate == RATE_FAST) adc_scan(tick);
  if (pin == LOW) {
    OCR1A = TCNT1 + FAR;
    if (PINB & _BV(PULSE_BIT)) TCCR1C = _BV(FOC1A);  // toggled by a disturbance: back
  }
  if (mode != MODE_PAPER && silence_left && --silence_left == 0 && (running || queue_room() < QUEUE)) {
    rest();
    push(tick, EVENT_SILENT, 0, 0, 0);
  }
  if (!running) {
    if ((int32_t)(next_rise - tick) < 0) next_rise = tick;
  } else if (!prepared && pin != HIGH) {
    uint16_t ahead = (uint16_t)next_rise - TCNT1;
    if (ahead < NEAR || ahead > LIMIT) prepare();
  }
}

ISR(TIMER1_COMPB_vect) {
  if (prepared && !width && (int16_t)(TCNT1 - (uint16_t)next_rise) >= 0) frame_begins();
  if ((int16_t)(TCNT1 - (uint16_t)tick) >= 0) {
    every_millisecond();
    tick += SCAN_PERIOD;
  }
  // A frame without a pulse has no match at OCR1A, so it begins here
  uint16_t next = (uint16_t)tick;
  if (prepared && !width && (int16_t)((uint16_t)next_rise - next) < 0) next = (uint16_t)next_rise;
  // simavr 1.6 toggles twice where OCR1B is written in the very cycle of a match of OCR1A: let one that is close pass
  if (pin != LOW) while ((uint16_t)(OCR1A - TCNT1 + 1) < CLOSE) {}
  if ((int16_t)(next - TCNT1) < (int16_t)LEAST) next = TCNT1 + LEAST;
  OCR1B = next;
}

ISR(TIMER1_OVF_vect) { overflows++; }

void pulse_start(void) {
  // Clear on match and force one: low, whatever a boot loader has left
  TCCR1A = _BV(COM1A1);
  TCCR1C = _BV(FOC1A);
  TCCR1A = _BV(COM1A0);
  DDRB |= _BV(PULSE_BIT) | _BV(LIGHT_BIT);
  TCNT1 = 0;
  OCR1A = FAR;
  OCR1B = SCAN_PERIOD;
  steady.period = PERIOD_MAX;
  TIFR1 = _BV(OCF1A) | _BV(OCF1B) | _BV(TOV1);
  TIMSK1 = _BV(OCIE1A) | _BV(OCIE1B) | _BV(TOIE1);
  TCCR1B = _BV(CS11);
}

void pulse_set(uint16_t w, uint16_t p) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    leave_queue();
    steady = (struct point){0, w, p};
    run();
  }
}

void pulse_play(uint32_t points) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    total = points;
    played = 0;
    steady.frames = 0;
    playing = 1;
    run();
  }
}

void pulse_clear(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    leave_queue();
    queue_clear();
  }
}

void pulse_limp(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) rest();
}

void pulse_heard(void) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) silence_left = SILENCE_MS;
}

void pulse_mode(uint8_t new_mode) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    rest();
    mode = new_mode;
    if (mode == MODE_PAPER) {
      steady = (struct point){0, 0, PAPER_PERIOD};  // no pulse before the first count
      run();
    }
  }
}

void pulse_rate(uint8_t new_rate) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) rate = new_rate;
}

void pulse_count(struct pulse_counts *counts) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    uint8_t pulsing = !running ? 0 : playing ? 2 : steady.width ? 1 : 0;
    *counts = (struct pulse_counts){played, frames, late, pulsing, queue_room()};
  }
}

void pulse_now(uint16_t *w, uint16_t *p) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    *w = running ? shown_width : 0;
    *p = running ? shown_period : 0;
  }
}

uint8_t pulse_take(struct edge *edge) {
  uint8_t place = tail;
  if (place == head) return 0;
  barrier();
  *edge = edges[place % EDGES];
  barrier();
  tail = place + 1;
  return 1;
}

uint8_t pulse_lost(void) {
  uint8_t was;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    was = lost;
    lost = 0;
  }
  return was;
}

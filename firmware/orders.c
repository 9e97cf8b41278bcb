#include "orders.h"
#include <string.h>
#include <util/atomic.h>
#include "adc.h"
#include "board.h"
#include "paper.h"
#include "pulse.h"
#include "queue.h"
#include "tell.h"

#define POINTS_MAX 10u

static uint8_t mode, cause;
static struct message_stream asked;  // by the last `stream`

static void apply_stream(void) {
  // Mode "paper" has its own reference, and reads what it needs whatever else is asked for
  pulse_rate(RATE_OFF);  // no scan may start in between
  adc_configure(asked.mask, mode == MODE_PAPER ? PAPER_CHANNELS : 0, orders_reference());
  tell_configure(asked.mask, asked.rate);
  pulse_rate(asked.rate);
}

static void change_mode(uint8_t new_mode) {
  if (new_mode == mode) return;
  pulse_limp();
  mode = new_mode;
  apply_stream();
  pulse_mode(mode);
}

static uint8_t is_pulse(uint16_t width, uint16_t period) {
  if (period < PERIOD_MIN || period > PERIOD_MAX) return 0;
  return !width || (width >= WIDTH_MIN && width <= WIDTH_MAX && width <= period - LOW_MIN);
}

static uint8_t set_pulse(const struct message_pulse *order) {
  if (!is_pulse(order->width, order->period)) return RESULT_RANGE;
  pulse_set(order->width, order->period);
  return RESULT_OK;
}

static uint8_t add_points(const struct message_points *order, uint8_t length) {
  const struct point *points = (const struct point *)(order + 1);
  uint8_t n = (length - LENGTH_POINTS) / sizeof(struct point), result = RESULT_OK;
  for (uint8_t k = 0; k < n; k++)
    if (!points[k].frames || !is_pulse(points[k].width, points[k].period)) return RESULT_RANGE;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    if (order->first != queue_next()) result = RESULT_ORDER;
    else if (n > queue_room()) result = RESULT_FULL;
    else for (uint8_t k = 0; k < n; k++) queue_add(points + k);
  }
  return result;
}

static uint8_t play(const struct message_play *order) {
  struct pulse_counts counts;
  pulse_count(&counts);
  if (!order->total || counts.room == QUEUE) return RESULT_RANGE;
  pulse_play(order->total);
  return RESULT_OK;
}

static uint8_t stream(const struct message_stream *order) {
  if (order->mask >= _BV(CHANNEL_COUNT) || order->rate >= RATE_COUNT || order->reference >= REFERENCE_COUNT)
    return RESULT_RANGE;
  asked = *order;
  apply_stream();
  return RESULT_OK;
}

static uint8_t set_mode(const struct message_mode *order) {
  if (order->mode >= MODE_COUNT) return RESULT_RANGE;
  change_mode(order->mode);
  return RESULT_OK;
}

static uint8_t has_length(uint8_t kind, uint8_t length) {
  switch (kind) {
    case KIND_PULSE: return length == LENGTH_PULSE;
    case KIND_PLAY: return length == LENGTH_PLAY;
    case KIND_STREAM: return length == LENGTH_STREAM;
    case KIND_MODE: return length == LENGTH_MODE;
    case KIND_POINTS: {
      uint8_t rest = length - LENGTH_POINTS;
      return length > LENGTH_POINTS && rest % sizeof(struct point) == 0 && rest <= POINTS_MAX * sizeof(struct point);
    }
    default: return length == 0;
  }
}

static uint8_t result_of(const struct frame *heard) {
  const void *payload = heard->payload;
  uint8_t kind = heard->kind;
  if (kind < KIND_HELLO || kind > KIND_MODE) return RESULT_UNKNOWN;
  if (!has_length(kind, heard->length)) return RESULT_LENGTH;
  uint8_t moves = kind == KIND_PULSE || kind == KIND_POINTS || kind == KIND_CLEAR || kind == KIND_PLAY;
  if (moves && mode == MODE_PAPER) return RESULT_MODE;
  switch (kind) {
    case KIND_PULSE: return set_pulse(payload);
    case KIND_POINTS: return add_points(payload, heard->length);
    case KIND_CLEAR: pulse_clear(); return RESULT_OK;
    case KIND_PLAY: return play(payload);
    case KIND_LIMP: pulse_limp(); change_mode(MODE_COMPUTER); return RESULT_OK;
    case KIND_STREAM: return stream(payload);
    case KIND_MODE: return set_mode(payload);
    default: return RESULT_OK;
  }
}

static void send_done(const struct frame *heard, uint8_t result) {
  struct message_done *done = (void *)wire_frame.payload;
  done->answers = heard->sequence;
  done->result = result;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    done->value = heard->kind == KIND_POINTS || heard->kind == KIND_CLEAR ? queue_next() : 0;
    done->room = queue_room();
  }
  wire_send(&wire_frame, KIND_DONE, pulse_time(), sizeof *done);
}

static void send_identity(const struct frame *heard) {
  struct message_identity *identity = (void *)wire_frame.payload;
  *identity = (struct message_identity){.answers = heard->sequence, .major = FIRMWARE_MAJOR, .minor = FIRMWARE_MINOR,
                                        .mode = mode, .cause = cause};
  memcpy(identity->name, "servotwn", sizeof identity->name);
  wire_send(&wire_frame, KIND_IDENTITY, pulse_time(), sizeof *identity);
}

static void send_status(const struct frame *heard) {
  struct message_status *status = (void *)wire_frame.payload;
  struct pulse_counts counts;
  pulse_count(&counts);
  *status = (struct message_status){
    .answers = heard->sequence, .mode = mode, .pulsing = counts.pulsing, .room = counts.room, .played = counts.played,
    .frames = counts.frames, .good = wire_counts.good, .bad = wire_counts.bad, .dropped = wire_counts.dropped,
    .late = counts.late};
  wire_send(&wire_frame, KIND_STATUS, pulse_time(), sizeof *status);
}

void orders_start(uint8_t reset_cause) {
  cause = reset_cause;
  if (!(PINB & _BV(JUMPER_BIT))) change_mode(MODE_PAPER);
}

void orders_obey(const struct frame *heard) {
  pulse_heard();
  uint8_t result = result_of(heard);
  if (result == RESULT_OK && heard->kind == KIND_HELLO) send_identity(heard);
  else if (result == RESULT_OK && heard->kind == KIND_ASK) send_status(heard);
  else send_done(heard, result);
}

uint8_t orders_mode(void) { return mode; }

uint8_t orders_reference(void) { return mode == MODE_PAPER ? REFERENCE_EXTERNAL : asked.reference; }

#include "wire.h"
#include <avr/interrupt.h>
#include <util/crc16.h>
#include "board.h"

#define OVERHEAD 10u                                 // head and crc
#define LONGEST (LONGEST_PAYLOAD + OVERHEAD)
#define LONGEST_STUFFED (LONGEST + 1u)               // one byte more as long as a frame has less than 255

_Static_assert(LONGEST < 255, "one code byte of COBS must be enough");

#define HEARING 128u                                  // bytes, a power of two; 2.5 ms of the wire

static uint8_t sending[256];                         // a ring; its index wraps by itself
static uint8_t hearing[HEARING];
static volatile uint8_t send_head, send_tail, hear_head, hear_tail;
static uint8_t sequence;
struct wire_counts wire_counts;
struct frame wire_frame;

void wire_start(void) {
  UCSR0A = _BV(U2X0);
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UBRR0 = F_CPU / (8ul * BAUD) - 1;  // last: simavr finds the speed out here
  UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

ISR(USART_RX_vect) {
  uint8_t byte = UDR0, next = (hear_head + 1) % HEARING;
  if (next == hear_tail) return;  // lost; the crc will tell
  hearing[hear_head] = byte;
  hear_head = next;
}

ISR(USART_UDRE_vect) {
  uint8_t at = send_tail;
  UDR0 = sending[at++];
  send_tail = at;
  if (at == send_head) UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

static uint16_t crc_of(const uint8_t *bytes, uint8_t n) {
  uint16_t crc = 0xFFFF;
  while (n--) crc = _crc_xmodem_update(crc, *bytes++);
  return crc;
}

void wire_drop(uint8_t frames) {
  sequence += frames;
  wire_counts.dropped += frames;
}

void wire_send(struct frame *frame, uint8_t kind, uint32_t time, uint8_t length) {
  uint8_t n = length + OVERHEAD;
  if ((uint8_t)(send_tail - send_head - 1) < n + 3) {
    wire_drop(1);
    return;
  }
  frame->length = length;
  frame->version = VERSION;
  frame->sequence = sequence++;
  frame->kind = kind;
  frame->time = time;
  uint16_t crc = crc_of((uint8_t *)frame, n - 2);
  frame->payload[length] = (uint8_t)crc;
  frame->payload[length + 1] = crc >> 8;
  uint8_t at = send_head, code_at = ++at, code = 1;
  sending[send_head] = 0;
  at++;
  const uint8_t *bytes = (const uint8_t *)frame;
  while (n--) {
    if (*bytes) {
      sending[at++] = *bytes;
      code++;
    } else {
      sending[code_at] = code;
      code_at = at++;
      code = 1;
    }
    bytes++;
  }
  sending[code_at] = code;
  sending[at++] = 0;
  barrier();
  send_head = at;
  UCSR0B |= _BV(UDRIE0);
}

// Take the stuffing out in place: what comes out is never ahead of what goes in. 0: it is not stuffed as it should be.
static uint8_t unstuff(uint8_t *bytes, uint8_t n) {
  uint8_t in = 0, out = 0;
  while (in < n) {
    uint8_t code = bytes[in++];
    if (code - 1 > n - in) return 0;
    for (uint8_t k = 1; k < code; k++) bytes[out++] = bytes[in++];
    if (in < n) bytes[out++] = 0;
  }
  return out;
}

static uint8_t is_valid(const struct frame *frame, uint8_t n) {
  const uint8_t *bytes = (const uint8_t *)frame;
  if (n < OVERHEAD || frame->length > LONGEST_PAYLOAD || n != frame->length + OVERHEAD) return 0;
  uint16_t crc = crc_of(bytes, n - 2);
  return frame->version == VERSION && bytes[n - 2] == (uint8_t)crc && bytes[n - 1] == crc >> 8;
}

const struct frame *wire_hear(void) {
  static union { uint8_t bytes[LONGEST_STUFFED]; struct frame frame; } heard;
  static uint8_t n;  // LONGEST_STUFFED + 1: too long
  while (hear_tail != hear_head) {
    barrier();
    uint8_t byte = hearing[hear_tail];
    hear_tail = (hear_tail + 1) % HEARING;
    if (byte) {
      if (n < LONGEST_STUFFED) heard.bytes[n] = byte;
      if (n <= LONGEST_STUFFED) n++;
      continue;
    }
    uint8_t length = n;
    n = 0;
    if (!length) continue;
    if (length <= LONGEST_STUFFED && is_valid(&heard.frame, unstuff(heard.bytes, length))) {
      wire_counts.good++;
      return &heard.frame;
    }
    wire_counts.bad++;
  }
  return 0;
}

uint8_t wire_is_quiet(void) { return hear_tail == hear_head; }

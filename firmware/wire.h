// The serial wire: bytes in interrupts, frames in the main loop.
#pragma once
#include <stdint.h>
#include "protocol.h"

#define HEAD_LENGTH 8u
struct frame {
  uint8_t length, version, sequence, kind;
  uint32_t time;
  uint8_t payload[LONGEST_PAYLOAD];
  uint8_t crc[2];  // stands behind the payload, which is shorter most of the time
};

struct wire_counts { uint16_t good, bad, dropped; };
extern struct wire_counts wire_counts;
extern struct frame wire_frame;  // for whoever makes a frame and sends it at once

void wire_start(void);
// Send it, all or nothing: where there is no room it is counted as dropped. length, version, sequence are filled in.
void wire_send(struct frame *frame, uint8_t kind, uint32_t time, uint8_t length);
void wire_drop(uint8_t frames);                  // count frames that could not even be made
const struct frame *wire_hear(void);             // the next valid frame, or none; valid until the next call
uint8_t wire_is_quiet(void);                     // nothing is to be heard

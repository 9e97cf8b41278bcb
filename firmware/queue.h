// The points that are to be played: a ring that the wire fills and the pulses empty.
#pragma once
#include <stdint.h>

struct point { uint16_t frames, width, period; };  // as they come over the wire, packed (an AVR does not align)

// Interrupts off for all of these.
void queue_clear(void);
void queue_add(const struct point *point);  // there is room
uint8_t queue_take(struct point *point);    // 0: empty
uint8_t queue_room(void);
uint16_t queue_next(void);                  // number of the next point to come

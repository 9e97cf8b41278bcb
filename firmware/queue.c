#include "queue.h"
#include "protocol.h"

static struct point points[QUEUE];
static uint8_t first, held;
static uint16_t next;

void queue_clear(void) {
  held = 0;
  next = 0;
}

void queue_add(const struct point *point) {
  uint8_t at = first + held;
  points[at >= QUEUE ? at - QUEUE : at] = *point;
  held++;
  next++;
}

uint8_t queue_take(struct point *point) {
  if (!held) return 0;
  *point = points[first];
  if (++first == QUEUE) first = 0;
  held--;
  return 1;
}

uint8_t queue_room(void) { return QUEUE - held; }

uint16_t queue_next(void) { return next; }

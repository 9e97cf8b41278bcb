#include "tell.h"
#include <string.h>
#include "adc.h"
#include "board.h"
#include "pulse.h"
#include "wire.h"

static struct frame batch;
static uint8_t mask, bytes_per_scan, rate;
static uint8_t batched;  // bytes of the payload of the batch, 0: empty
static struct edge edge; // the one that is told next
static struct scan scan; // the one that is told next
static uint8_t has_edge, has_scan;

void tell_configure(uint8_t new_mask, uint8_t new_rate) {
  struct edge forgotten;
  while (pulse_take(&forgotten)) if (forgotten.event) tell_event(forgotten.event, forgotten.time);
  mask = new_mask;
  rate = new_rate;
  bytes_per_scan = 0;
  for (uint8_t bits = mask; bits; bits >>= 1) bytes_per_scan += bits & 1 ? 2 : 0;
  batched = has_edge = has_scan = 0;
}

void tell_event(uint8_t event, uint32_t time) {
  struct message_event *message = (void *)wire_frame.payload;
  struct pulse_counts counts;
  pulse_count(&counts);
  *message = (struct message_event){event, counts.played};
  wire_send(&wire_frame, KIND_EVENT, time, sizeof *message);
}

static void send_edge(uint8_t with_scan) {
  struct message_edge *message = (void *)wire_frame.payload;
  *message = (struct message_edge){edge.width, edge.period, with_scan ? mask : 0};
  uint8_t counts = with_scan ? bytes_per_scan : 0;
  memcpy(message + 1, scan.counts, counts);
  wire_send(&wire_frame, KIND_EDGE, edge.time, sizeof *message + counts);
}

static void send_batch(void) {
  if (batched) wire_send(&batch, KIND_SAMPLES, batch.time, batched);
  batched = 0;
}

static void add_to_batch(void) {
  static uint32_t next;
  if (batched && scan.time != next) send_batch();  // a scan is missing
  if (!batched) {
    batch.time = scan.time;
    batch.payload[0] = mask;
    batched = 1;
  }
  memcpy(batch.payload + batched, scan.counts, bytes_per_scan);
  batched += bytes_per_scan;
  next = scan.time + SCAN_PERIOD;
  if (batched + bytes_per_scan > LONGEST_PAYLOAD) send_batch();
}

// 0: the edge has a scan that is not ready yet.
static uint8_t tell_edge(void) {
  if (edge.event) tell_event(edge.event, edge.time);
  edge.event = 0;
  if (rate == RATE_OFF || !edge.period) return 1;
  if (!edge.scanned || rate != RATE_FRAME) {
    send_edge(0);
    return 1;
  }
  while (has_scan || (has_scan = adc_take(&scan))) {
    int32_t after = scan.time - edge.time;
    if (after <= 0) has_scan = 0;  // read at this edge, or at one that was not told
    if (after < 0) continue;
    send_edge(after == 0 && bytes_per_scan);
    return 1;
  }
  return 0;
}

void tell_all(void) {
  wire_drop(pulse_lost() + adc_lost());
  while (has_edge || (has_edge = pulse_take(&edge))) {
    if (!tell_edge()) return;
    has_edge = 0;
  }
  if (rate == RATE_FRAME) return;
  while (adc_take(&scan)) if (rate == RATE_FAST && bytes_per_scan) add_to_batch();
}

// The pulses at OC1A, the time, and all that happens in step with them.
#pragma once
#include <stdint.h>
#include "queue.h"

struct edge {             // what the main loop is told of the beginning of a frame, or of an event
  uint32_t time;          // of the rising edge
  uint16_t width, period; // period 0: only an event
  uint8_t event;          // 0: none
  uint8_t scanned;        // a scan was started at this edge
};

struct pulse_counts { uint32_t played, frames; uint16_t late; uint8_t pulsing, room; };

void pulse_start(void);
uint32_t pulse_time(void);
void pulse_set(uint16_t width, uint16_t period);
void pulse_play(uint32_t total);
void pulse_clear(void);        // the queue; a pulse that goes on goes on
void pulse_limp(void);
void pulse_heard(void);        // a valid frame: `silence` begins again
void pulse_mode(uint8_t mode);
void pulse_rate(uint8_t rate); // when channels are read, and whether edges are told
void pulse_count(struct pulse_counts *counts);
void pulse_now(uint16_t *width, uint16_t *period); // of the frame that is under way, or the last one
uint8_t pulse_take(struct edge *edge);      // 0: nothing happened
uint8_t pulse_lost(void);                   // edges for which there was no room since the last call

// The converter: a scan reads some channels one after the other, and its interrupt leads it from one to the next.
#pragma once
#include <stdint.h>
#include "protocol.h"

struct scan {
  uint32_t time;                  // of its start
  uint16_t counts[CHANNEL_COUNT]; // in the order of the scan
};

extern volatile uint16_t adc_latest[CHANNEL_COUNT];
extern volatile uint8_t adc_known;  // channels that have a latest count

void adc_start(void);
// What scans read from now on: first the channels of `mask`, then those of `more`. What was read before is forgotten.
void adc_configure(uint8_t mask, uint8_t more, uint8_t reference);
uint8_t adc_scan(uint32_t time);        // interrupts off; 0: there is nothing to read, or no room
uint8_t adc_take(struct scan *scan);    // 0: no scan is ready
uint8_t adc_lost(void);                 // scans for which there was no room since the last call

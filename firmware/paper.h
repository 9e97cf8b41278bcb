// The paper's generator: a count of the command voltage becomes the width of a pulse.
#pragma once
#include <stdint.h>

#define PAPER_PERIOD 32768u  // 1024 steps of 16 us: 61.035 Hz
#define PAPER_CHANNELS (_BV(CHANNEL_TAP) | _BV(CHANNEL_COMMAND))  // what its display needs

uint16_t paper_width(uint16_t count);  // ticks

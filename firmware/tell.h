// What the board tells by itself: edges, samples, events.
#pragma once
#include <stdint.h>

void tell_configure(uint8_t mask, uint8_t rate);  // what was not told yet of the last configuration is forgotten
void tell_event(uint8_t event, uint32_t time);
void tell_all(void);

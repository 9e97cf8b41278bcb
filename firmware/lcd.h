// A display of 16x2 characters, HD44780, four data lines, written only: one byte at a time, whenever the main loop passes.
#pragma once
#include <stdint.h>
#include "readings.h"

void lcd_start(void);
// Send the next byte if the display has had its time; 1: it shows all of the text and wants the next one.
uint8_t lcd_step(uint32_t time, const char text[2 * LINE]);

// What is wired where on an Uno or a Nano.
#pragma once
#include <avr/io.h>
#include <stdint.h>
#include "protocol.h"

#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 0

#define PULSE_BIT PB1     // D9, OC1A
#define JUMPER_BIT PB0    // D8, to ground: mode "paper" at the start
#define LIGHT_BIT PB5     // D13, on while the queue plays
#define LCD_RS_BIT PD2    // D2
#define LCD_E_BIT PD3     // D3
#define LCD_DATA_MASK 0xF0  // D4 to D7 are DB4 to DB7

static inline void light(uint8_t on) {
  if (on) PORTB |= _BV(LIGHT_BIT); else PORTB &= (uint8_t)~_BV(LIGHT_BIT);
}

// Rings are filled in interrupts: what stands before this in the text happens before.
#define barrier() __asm__ volatile("" ::: "memory")

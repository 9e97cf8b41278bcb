// What the computer orders, and the answers.
#pragma once
#include "wire.h"

void orders_start(uint8_t cause);         // of the reset
void orders_obey(const struct frame *heard);
uint8_t orders_mode(void);
uint8_t orders_reference(void);           // of the converter, as it is now

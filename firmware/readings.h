// The readings as the paper's display shows them.
#pragma once
#include <stdint.h>

#define LINE 16u

// Two lines, one behind the other: V_i, ADC_i, t_a and V_o, ADC_o, f, q.
void readings_text(char text[2 * LINE], uint8_t mode, uint8_t reference);

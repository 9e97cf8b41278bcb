#include "paper.h"
#include <stdint.h>

#define STEP 32u  // 16 us
#define BASE 12u  // 6 us

// t_a = 16 m + 6 us with m = floor((count - 1)/6) - 1, at least 0.
uint16_t paper_width(uint16_t count) {
  if (count < 13) return BASE;
  // n/6 without a division, exact below 1024: this runs in an interrupt
  uint16_t sixth = ((uint32_t)(count - 1) * 10923u) >> 16;
  return STEP * (sixth - 1) + BASE;
}

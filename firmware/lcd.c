#include "lcd.h"
#include <util/delay.h>
#include "board.h"

#define WAKES 100000ul  // ticks; 50 ms after power comes, data sheet: more than 40 ms
#define SLOW 10000u     // ticks; 5 ms, data sheet: 4.1 ms for the first order, 1.5 ms to clear
#define FAST 200u       // ticks; 100 us, data sheet: 41 us; some have a slower clock

// The first four are half a byte: eight lines three times, whatever it was in before, then four. Data sheet, figure 24.
static const uint8_t wake[] = {0x3, 0x3, 0x3, 0x2, 0x28, 0x08, 0x01, 0x06, 0x0C};
#define HALVES 4u
#define SET_LINE_1 0x80
#define SET_LINE_2 0xC0

static uint32_t due;
static uint8_t step;  // of `wake`, then address, line, address, line

void lcd_start(void) {
  DDRD |= LCD_DATA_MASK | _BV(LCD_RS_BIT) | _BV(LCD_E_BIT);
  // D2 and D3 are INT0 and INT1 too. They are not used, but simavr 1.6 looks at a low one each cycle unless told "edges"
  EICRA = _BV(ISC11) | _BV(ISC10) | _BV(ISC01) | _BV(ISC00);
  due = WAKES;
}

static void half(uint8_t nibble, uint8_t rs) {
  uint8_t lines = (PORTD & (uint8_t)~(LCD_DATA_MASK | _BV(LCD_RS_BIT) | _BV(LCD_E_BIT))) | nibble << 4 | rs;
  PORTD = lines;
  PORTD = lines | _BV(LCD_E_BIT);
  _delay_us(1);  // data sheet: 0.45 us
  PORTD = lines;
  _delay_us(1);
}

static void whole(uint8_t byte, uint8_t rs) {
  half(byte >> 4, rs);
  half(byte & 15, rs);
}

uint8_t lcd_step(uint32_t time, const char text[2 * LINE]) {
  if ((int32_t)(time - due) < 0) return 0;
  due = time + FAST;
  if (step < sizeof wake) {
    due = time + SLOW;
    if (step < HALVES) half(wake[step], 0); else whole(wake[step], 0);
    return ++step == sizeof wake;
  }
  uint8_t place = step - sizeof wake;  // 0 and 17 are addresses
  if (place == 0) whole(SET_LINE_1, 0);
  else if (place == LINE + 1) whole(SET_LINE_2, 0);
  else whole(text[place <= LINE ? place - 1 : place - 2], _BV(LCD_RS_BIT));
  if (place < 2 * LINE + 1) {
    step++;
    return 0;
  }
  step = sizeof wake;
  return 1;
}

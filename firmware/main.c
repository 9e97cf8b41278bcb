// The firmware of the bench: pulses and readings happen in interrupts; here is what has time.
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include "adc.h"
#include "board.h"
#include "lcd.h"
#include "orders.h"
#include "pulse.h"
#include "readings.h"
#include "tell.h"
#include "wire.h"

#define SHOW_EVERY (TICKS_PER_SECOND / 4)

static void show(uint32_t time) {
  static char text[2 * LINE];
  static uint32_t next;
  static uint8_t full;  // the text is on its way
  if (!full) {
    if ((int32_t)(time - next) < 0) return;
    next = time + SHOW_EVERY;
    readings_text(text, orders_mode(), orders_reference());
    full = 1;  // and on the next pass its first byte: making a text takes longer than the display does
  } else if (lcd_step(time, text)) {
    full = 0;
  }
}

// Until the next interrupt, which comes within a millisecond.
static void rest(void) {
  cli();
  if (wire_is_quiet()) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}

int main(void) {
  uint8_t cause = MCUSR;
  MCUSR = 0;
  PORTB |= _BV(JUMPER_BIT);  // pull-up
  pulse_start();
  adc_start();
  wire_start();
  lcd_start();
  set_sleep_mode(SLEEP_MODE_IDLE);
  sei();
  orders_start(cause);
  tell_event(EVENT_RESET, pulse_time());
  for (;;) {
    const struct frame *heard = wire_hear();
    if (heard) orders_obey(heard);
    tell_all();
    show(pulse_time());
    rest();
  }
}

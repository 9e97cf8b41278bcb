// The firmware of the bench: pulses and readings happen in interrupts; here is what has time.
#include <avr/interrupt.h>
#include "adc.h"
#include "board.h"
#include "orders.h"
#include "pulse.h"
#include "tell.h"
#include "wire.h"

int main(void) {
  uint8_t cause = MCUSR;
  MCUSR = 0;
  PORTB |= _BV(JUMPER_BIT);  // pull-up
  pulse_start();
  adc_start();
  wire_start();
  sei();
  orders_start(cause);
  tell_event(EVENT_RESET, pulse_time());
  for (;;) {
    const struct frame *heard = wire_hear();
    if (heard) orders_obey(heard);
    tell_all();
  }
}

"""Supplies that fall, and servos on them."""

import servotwin as st
from servotwin.datasheet.holding import on_supply

SG90, BIG, STS, XL = "towerpro-sg90", "hitec-hs-755hb", "feetech-sts3215-12v", "dynamixel-xl330-m288"
SITUATIONS = [  # servo, supply, torque against the shaft [N m]
    (SG90, "usb", 0.0), (SG90, "4.5V:0.6ohm", 0.0), (SG90, "5V:0.2A", 0.0), (SG90, "5V:3ohm", 0.0),
    (SG90, "5V:3ohm:0.35A", 0.02), (BIG, "6V:0.5ohm", 0.0), (BIG, "7.4V:0.1ohm", 0.3), (BIG, "6V:1A", 0.1),
    (STS, "12V:0.3ohm", 0.0), (STS, "12V:0.3ohm:2A", 0.5), (STS, "12V:5A", 0.0), (XL, "usb", 0.05)]


def model_of(name, supply):
    servo = on_supply(st.load_servo(name), st.Supply.of(supply))
    plain = dict.fromkeys(("gear.backlash", "gear.output_inertia", "friction.load_friction",
                           "friction.load_friction_motor", "friction.load_friction_external"))
    return (st.DigitalServo if servo.kind == "bus" else st.PulseServo)(servo.replace(plain))

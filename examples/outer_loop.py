"""What a hobbyist can do over pulses: plain commands, the inverse servo as feedforward, and a tap of the potentiometer.

The servo lifts an arm of which the program knows the mass, and then also holds a weight of which it knows nothing.
"""

import math

import servotwin as st
from servotwin import control

FRAME = 0.02  # s

servo = st.load_servo("hitec-hs-755hb")
model = st.PulseServo(servo)
arm = st.loads.Pendulum(mass=0.2, length=0.15)
weight = st.loads.Constant(0.15)
tap = control.Tap.of(servo, bits=10, reference_voltage=2.5)
lift = control.s_curve([0.2, 1.6, 0.2], speed=2.5, acceleration=15.0, jerk=200.0)

inverse = control.inverse_of(model, arm)
plain = control.PlainCommand(period=FRAME)
feedforward = control.AheadOfServo(
    controller=control.Feedforward(period=FRAME, inverse=inverse, load_torque=control.LoadModel(arm)), inverse=inverse)
rate = control.tuning.integral_rate(inverse, period=FRAME, frame=FRAME)
tapped = control.AheadOfServo(
    controller=control.Feedforward(
        period=FRAME, inverse=inverse, load_torque=control.LoadModel(arm),
        feedback=control.Pid(period=FRAME, integral_gain=rate * inverse.volts_per_error, filter_rate=1.0 / FRAME)),
    inverse=inverse)

for words, load in (("the arm", arm), ("the arm and an unknown weight", arm + weight)):
    print(f"{words}, {lift.duration:.2f} s there and back and 1 s of rest")
    for name, controller in (("plain commands", plain), ("feedforward, no sensor", feedforward),
                             ("feedforward and a tap", tapped)):
        port = control.SimulatedServo(model, load, sensors=[tap])
        run = control.run_loop(port, controller, lift, lift.duration + 1.0)
        print(f"  {name:24} rms {math.degrees(run.rms_error()):5.2f} deg   at the end "
              f"{math.degrees(run.error()[-1]):5.2f} deg   {run.energy:.2f} J   {run.reversals:.0f} reversals a second")

"""Servos without what no transfer function knows: friction, deadband, play."""

import servotwin as st


def bare(name):
    servo = st.load_servo(name)
    off = [key for key in servo.names() if key.startswith(("friction.load_friction", "friction.coulomb_torque"))
           or key.endswith(("deadband", "gear.backlash"))]
    return servo.replace(dict.fromkeys(off, 0.0))

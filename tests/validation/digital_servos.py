"""Random digital servos of the reference as servotwin has them: servo, command and load."""

from __future__ import annotations

from dataclasses import replace

import servotwin as st
from reference import digital_cases
from servotwin.physics.pieces import Piece, Pieces


def case_of(seed, linear):
    """Return a case whose torques over time are continuous, and what holds them as a record; None for constant ones."""
    case = digital_cases.case(seed, linear)
    case.values["motor"].setdefault("motor_viscous_friction", 0.0)
    torque = case.load["torque"]
    if not isinstance(torque, list):
        return case, None
    times = [piece[0] for piece in torque] + [1.01 * case.duration]
    values = [piece[1] for piece in torque]
    values.append(values[-1])
    pieces = [(t, x, (y - x) / (u - t)) for t, u, x, y in zip(times, times[1:], values, values[1:], strict=False)]
    return case._replace(load={**case.load, "torque": pieces}), (times, values)


def model_of(case):
    """Return the model of a case."""
    groups = {name: group for name, group in case.values.items() if group}
    return st.DigitalServo(st.servo_from_values("case", groups, kind="digital"))


def command_of(case):
    """Return what it is told."""
    if case.command["kind"] == "pulse":
        return st.signals.pulse_train(case.command["edges"], case.command["widths"], unit="s")
    pieces = Pieces(tuple(Piece(*piece) for piece in case.command["pieces"]))
    return replace(st.signals.constant(0.0, unit="rad"), pieces=pieces, initial=pieces.table[0].value)


def load_of(case, record):
    """Return what hangs on its shaft."""
    own = case.load
    load = st.loads.Inertia(own["inertia"]) + st.loads.Viscous(own.get("viscous_friction", 0.0))
    load += st.loads.Recorded(*record) if record else st.loads.Constant(own["torque"])
    if "stiffness" in own:
        load += st.loads.Spring(own["stiffness"], own["rest"])
    if "pendulum" in own:
        load += st.loads.Pendulum(own["pendulum"]["mass"], own["pendulum"]["length"])
    return load

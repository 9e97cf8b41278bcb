"""The servos of this scenario: their numbers, what differs between them, and what they are told."""

import numpy as np

import servotwin as st

DURATION, TICK = 2.0, 1e-3  # s
COUNT = 2.0 * np.pi / 4096.0
PLANT = {
    "motor": {"armature_resistance": 3.0, "torque_constant": 3e-3, "back_emf_constant": 3e-3, "rotor_inertia": 1e-8,
              "motor_viscous_friction": 1e-8},
    "gear": {"gear_reduction": 345.0}, "friction": {"coulomb_torque_forward": 2e-4, "coulomb_torque_backward": 2e-4},
    "supply": {"open_circuit_voltage": 12.0},
    "firmware": {"control_period": TICK, "compute_delay": TICK, "command_kind": "goal", "proportional_gain": 8.0,
                 "derivative_gain": 0.05, "angle_quantum": COUNT, "duty_limit": 0.97},
}


def fleet(lanes: int) -> dict[str, np.ndarray]:
    """Return what differs between servos: gain, voltage, friction, load."""
    rng = np.random.default_rng(1)
    return {"firmware.proportional_gain": rng.uniform(3.0, 15.0, lanes),
            "supply.open_circuit_voltage": rng.uniform(10.0, 12.6, lanes),
            "friction.coulomb_torque_forward": rng.uniform(5e-5, 4e-4, lanes),
            "load.inertia": rng.uniform(5e-4, 5e-3, lanes), "load.torque": rng.uniform(-0.3, 0.3, lanes)}


def commands(lanes: int) -> list[st.signals.Signal]:
    """Return goals that jump five times a second, 64 different ones."""
    rng = np.random.default_rng(2)
    times = np.arange(0.0, DURATION, 0.2)
    some = [st.signals.samples(times, rng.uniform(-1.0, 1.0, len(times)), unit="rad", hold="previous")
            for _ in range(64)]
    return [some[k % 64] for k in range(lanes)]


def model_of_fleet() -> st.DigitalServo:
    """Return the model of all of them."""
    return st.DigitalServo(st.servo_from_values("fleet", PLANT, kind="bus"))

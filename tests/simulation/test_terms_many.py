"""Random servos with every effect of the drive train as lanes of one batch: each is what `simulate` says of it."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from reference.drivetrain_cases import TERMS, command_of, load_of, random_case, servo_of
from reference.drivetrain_laws import make_plant

pytestmark = pytest.mark.long

DURATION = 0.15
TIMES = np.linspace(0.0, DURATION, 16)
ANGLES, ERRORS = (-0.5, 0.5, 1.5, 2.5, 3.5), (0.01, -0.01, 0.015, 0.0, -0.02)  # one table for all lanes
# What a lane has that its case leaves out.
ABSENT = {"friction.breakaway_ratio": 1.0, "friction.stribeck_exponent": 1.0, "gear.output_inertia": 0.0,
          "motor.brush_drop_voltage": 0.0, "supply.bridge_drop_voltage": 0.0, "supply.bridge_drop_resistance": 0.0,
          "supply.internal_resistance": 0.0, "stops.restitution": 0.0, "electronics.minimum_drive_time": 0.0,
          "electronics.back_emf_injection": 0.0, "electronics.supply_coupling": 0.0}
ONE_LAW = TERMS - {"m3", "m4", "m5"}


def cases(terms, count):
    """Servos that differ in all but what a batch shares: its table, and a linear stretcher."""
    made = [random_case(seed, frozenset(terms)).replace(
        potentiometer__linearity_angle=ANGLES, potentiometer__linearity_error=ERRORS,
        electronics__stretcher_time_constant=None) for seed in range(count)]
    made = [case.replace(friction__bearing_coulomb_torque=make_plant(case.values, case.load).bearing) for case in made]
    return [replace(case, duration=DURATION, initial={}) for case in made]


def columns(made):
    names = sorted({name for case in made for name in case.values} - {
        "potentiometer.linearity_angle", "potentiometer.linearity_error"})
    return {name: [case.values[name] if name in case.values else ABSENT[name] for case in made] for name in names}


@pytest.mark.parametrize("model", [st.PulseServo, st.PulseServoInductive])
def test_every_effect_in_every_lane(model):
    made = cases(ONE_LAW - ({"inductance"} if model is st.PulseServo else set()), 6)
    batch = st.simulate_many(
        model(servo_of(made[0])), [command_of(case) for case in made], duration=DURATION,
        load=[load_of(case) for case in made], parameters=columns(made), output_times=TIMES,
        outputs=("output_angle", "motor_angle", "winding_temperature", "feedback_voltage", "armature_current", "drive"))
    assert batch.ok
    for lane, case in enumerate(made):
        alone = st.simulate(model(servo_of(case)), command_of(case), duration=DURATION, load=load_of(case),
                            output_times=TIMES)
        for name in ("output_angle", "feedback_voltage", "winding_temperature"):
            np.testing.assert_allclose(batch[name][lane], alone[name], rtol=1e-12, atol=1e-12, err_msg=f"{name} {lane}")
        np.testing.assert_allclose(batch["motor_angle"][lane], alone["motor_angle"], rtol=1e-12, atol=1e-10)
        np.testing.assert_allclose(batch["armature_current"][lane], alone["armature_current"], rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(batch["drive"][lane], alone["drive"])

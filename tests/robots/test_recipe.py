"""What comes nearest to a servo among MuJoCo's actuators: exact where the servo has nothing else."""

import math

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import LENGTH, MASS, SPREAD, WEIGHT, hinge, servo
from servotwin.errors import InputError
from servotwin.robots import recipe_of

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
NO_FRICTION = {"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
               "electronics.voltage_deadband": 0.0}


def with_actuator(recipe, actuator, dt):
    xml = hinge("RK4", dt, f'axis="0 1 0" {recipe.joint()}')
    return mujoco.MjModel.from_xml_string(xml.replace("</mujoco>", f"<actuator>{actuator}</actuator></mujoco>"))


@pytest.mark.parametrize("goal", [0.05, 1.2])
def test_a_dcmotor_is_the_voltage_servo(goal):
    """Without friction and deadband: linear and saturated, within 1e-6 rad of `simulate`."""
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(NO_FRICTION))
    alone = st.simulate(model, st.signals.constant(goal, unit="rad"), duration=0.6, load=WEIGHT, output_step=1e-3,
                        initial={"output_angle": 0.0})
    recipe = recipe_of(model)
    own = with_actuator(recipe, recipe.dcmotor("elbow"), 2.5e-4)
    data, angle = mujoco.MjData(own), [0.0]
    data.ctrl[0] = goal
    for _ in range(600):
        mujoco.mj_step(own, data, 4)
        angle.append(data.qpos[0])
    assert np.abs(np.array(angle) - alone["output_angle"]).max() < 1e-6


def test_a_position_actuator_is_so_where_nothing_saturates():
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(NO_FRICTION))
    recipe = recipe_of(model)
    angles = []
    for actuator in (recipe.position("elbow"), recipe.dcmotor("elbow")):
        own = with_actuator(recipe, actuator, 2.5e-4)
        data = mujoco.MjData(own)
        data.ctrl[0] = 0.02
        mujoco.mj_step(own, data, 400)
        angles.append(data.qpos[0])
    assert angles[0] == pytest.approx(angles[1], abs=1e-9)


def test_what_a_register_means_in_newton_metres():
    """Twice the P of a bus servo is twice the stiffness; damping and stall torque stay."""
    soft, hard = (recipe_of(st.DigitalServo(st.feetech_sts({"P_Coefficient": P}, servo="feetech-sts3215-12v")))
                  for P in (16, 32))
    assert hard.stiffness == pytest.approx(2.0 * soft.stiffness)
    assert (hard.damping, hard.stall_torque) == (soft.damping, soft.stall_torque)
    assert hard.stall_torque == pytest.approx(hard.torque_constant * hard.voltage_limit / hard.resistance)


def test_a_held_weight_sags_by_its_torque_over_the_stiffness():
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(NO_FRICTION))
    result = st.simulate(model, st.signals.constant(0.0, unit="rad"), duration=3.0, load=WEIGHT)
    sag = result["output_angle"][-1]
    assert sag * recipe_of(model).stiffness == pytest.approx(MASS * 9.81 * LENGTH * math.cos(sag), rel=1e-6)
    assert SPREAD < sag


def test_what_has_no_gain_is_refused():
    with pytest.raises(InputError, match="recipe: got DCMotor"):
        recipe_of(st.DCMotor(st.load_servo("hitec-hs-755hb")))
    assert recipe_of(servo(st.PulseServo)) == recipe_of(servo(st.BoundedServo))

"""What comes nearest to a servo among MuJoCo's actuators: exact where it has nothing else, as strong elsewhere."""

import math

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import LENGTH, MASS, WEIGHT, hinge, servo
from servotwin.errors import InputError
from servotwin.models import default_model
from servotwin.robots import recipe_of
from servotwin.robots.actuator_recipe import arm_of, lift_of_twin

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
NO_FRICTION = {"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
               "electronics.voltage_deadband": 0.0}
LEROBOT = st.DigitalServo(st.feetech_sts({"P_Coefficient": 16, "D_Coefficient": 32}, servo="feetech-sts3215-12v"))
EIGHT = {"LeRobot's": LEROBOT, **{name: default_model(st.load_servo(name)) for name in (
    "feetech-sts3215-12v", "feetech-sts3215-7v4", "dynamixel-mx-64", "dynamixel-ax-12a", "hitec-hs-755hb",
    "towerpro-mg996r", "towerpro-sg90")}}


def free_servo():
    return st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(NO_FRICTION))


def with_actuator(recipe, actuator, dt):
    xml = hinge("RK4", dt, f'axis="0 1 0" {recipe.joint()}')
    return mujoco.MjModel.from_xml_string(xml.replace("</mujoco>", f"<actuator>{actuator}</actuator></mujoco>"))


@pytest.mark.parametrize("goal", [0.05, 1.2])
def test_a_dcmotor_is_the_voltage_servo(goal):
    """Without friction and deadband: linear and saturated, within 1e-5 rad of `simulate`."""
    model = free_servo()
    alone = st.simulate(model, st.signals.constant(goal, unit="rad"), duration=0.6, load=WEIGHT, output_step=1e-3,
                        initial={"output_angle": 0.0})
    recipe = recipe_of(model)
    own = with_actuator(recipe, recipe.dcmotor("elbow"), 2.5e-4)
    data, angle = mujoco.MjData(own), [0.0]
    data.ctrl[0] = goal
    for _ in range(600):
        mujoco.mj_step(own, data, 4)
        angle.append(data.qpos[0])
    assert np.abs(np.array(angle) - alone["output_angle"]).max() < 1e-5


def test_a_position_actuator_is_so_where_nothing_saturates():
    recipe = recipe_of(free_servo())
    angles = []
    for actuator in (recipe.position("elbow"), recipe.dcmotor("elbow")):
        own = with_actuator(recipe, actuator, 2.5e-4)
        data = mujoco.MjData(own)
        data.ctrl[0] = 0.02
        mujoco.mj_step(own, data, 400)
        angles.append(data.qpos[0])
    assert angles[0] == pytest.approx(angles[1], abs=1e-9)


def test_without_friction_the_droop_is_the_load_over_the_stiffness():
    """k_p is that of the linear zone then, K k_v/R, and F is 0, whatever the load."""
    model = free_servo()
    result = st.simulate(model, st.signals.constant(0.0, unit="rad"), duration=3.0, load=WEIGHT)
    sag = result["output_angle"][-1]
    for load in (0.05, 0.2):
        recipe = recipe_of(model, load=load)
        assert sag * recipe.stiffness == pytest.approx(MASS * 9.81 * LENGTH * math.cos(sag), rel=1e-4)
        assert recipe.friction_loss == pytest.approx(0.0, abs=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("name", [
    name if name in ("LeRobot's", "towerpro-sg90") else pytest.param(name, marks=pytest.mark.slow) for name in EIGHT])
def test_a_recipe_is_as_strong_as_its_servo(name):
    """Lift within 5 % of `curves`, both droops at the load within 10 % or 0.3 deg, by both actuators."""
    model = EIGHT[name]
    recipe = recipe_of(model)
    if name == "towerpro-sg90":
        assert recipe.lift == pytest.approx(st.curves(model, bandwidth=False).voltages[0].cold.stall_torque, rel=1e-3)
    error = recipe.error
    for actuator in (error.position, error.dcmotor):
        assert actuator.lift == pytest.approx(recipe.lift, rel=0.05)
        for own, twin in zip(actuator.droops, recipe.droops, strict=True):
            assert own == pytest.approx(twin, rel=0.1, abs=math.radians(0.3))
    assert "lift " in str(error)
    assert error.droops_at_half.up < error.droops.up


@pytest.mark.long
def test_the_recipe_of_lerobots_arm():
    """By hand kp 11.9, friction loss 0.686, range 3.53; the twin stands off 7.07 and 0.76 deg."""
    recipe = recipe_of(LEROBOT, load=0.85)
    assert recipe.stiffness == pytest.approx(11.9, rel=0.1)
    assert recipe.friction_loss == pytest.approx(0.686, rel=0.1)
    assert recipe.most_torque == pytest.approx(3.53, rel=0.02)
    assert math.degrees(recipe.droops.up) == pytest.approx(7.07, abs=0.3)
    assert math.degrees(recipe.droops.down) == pytest.approx(0.76, abs=0.3)
    assert recipe.voltage_limit == pytest.approx(0.97 * 11.6)  # behind the bridge
    assert any("load" in words for words in recipe.lacks)


@pytest.mark.long
def test_d_is_damping():
    """kv is what back-EMF takes, and k_d V K/R."""
    soft, hard = (recipe_of(st.DigitalServo(st.feetech_sts({"P_Coefficient": 16, "D_Coefficient": D},
                                                           servo="feetech-sts3215-12v"))) for D in (0, 32))
    K, R = hard.torque_constant, hard.resistance
    assert soft.damping == pytest.approx(K * soft.back_emf_constant / R)
    gain = hard.model.value("firmware.derivative_gain")
    assert hard.damping - soft.damping == pytest.approx(gain * 11.6 * K / R)


@pytest.mark.long
def test_a_joint_by_a_recipe_holds():
    """Where it has come up under its load; with MuJoCo's own `solimpfriction` it creeps to where none holds it."""
    recipe, crept = recipe_of(LEROBOT), []
    for joint in (recipe.joint(), recipe.joint().replace(' solimpfriction="0.9999 0.9999 0.001"', "")):
        model = arm_of(recipe, recipe.position("joint"), 0.01, joint=joint)
        data = mujoco.MjData(model)
        data.qfrc_applied[0] = -recipe.load
        data.qpos[0] = start = -(recipe.load + 0.9 * recipe.friction_loss) / recipe.stiffness
        mujoco.mj_step(model, data, 10000)
        crept.append(math.degrees(data.qpos[0] - start))
    assert abs(crept[0]) < 0.05
    assert crept[1] > 1.0


@pytest.mark.parametrize(("load", "message"), [
    (0.0, "load of a recipe of feetech-sts3215-12v: got 0.0, allowed: at least 0.05"), (float("nan"), "load of a"),
    (-1.0, "at least"), ("0.5", "at least"), (2.8, "tripped by"), (9.0, "allowed: less")])
def test_what_load_is_refused(load, message):
    with pytest.raises(InputError, match=message):
        recipe_of(LEROBOT, load=load)


def test_what_has_no_gain_is_refused():
    with pytest.raises(InputError, match="recipe: got DCMotor"):
        recipe_of(st.DCMotor(st.load_servo("hitec-hs-755hb")))
    assert lift_of_twin(servo(st.PulseServo)) == pytest.approx(lift_of_twin(servo(st.BoundedServo)), rel=1e-6)

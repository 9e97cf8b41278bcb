"""Unlike servos on one supply: each moves by its own numbers."""

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Motion, Mount, run_motion
from servotwin.robots.servos.servo_groups import differing, of_one_form

pytest.importorskip("mujoco")
VOLTS = 7.4
ARM = """<mujoco><option timestep="0.002"/><compiler angle="radian"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0"/>
<inertial pos="0.05 0 0" mass="0.06" diaginertia="1e-5 4e-5 4e-5"/>
<body name="lower" pos="0.1 0 0"><joint name="elbow" axis="0 1 0"/>
<inertial pos="0.03 0 0" mass="0.03" diaginertia="1e-5 2e-5 2e-5"/></body></body></worldbody></mujoco>"""


def model(name, **changes):
    return st.DigitalServo(st.load_servo(name).replace({"supply.open_circuit_voltage": VOLTS, **changes}))


def moved(servos, bus):
    import mujoco

    time = np.arange(0.0, 1.2, 0.02)
    angles = {"shoulder": 0.4 * np.sin(4.0 * time), "elbow": np.where(time > 0.3, 0.5, 0.0)}
    run = run_motion(mujoco.MjModel.from_xml_string(ARM), {joint: Mount(one) for joint, one in servos.items()},
                     Motion(time=time, angles=angles, source="a wave"), bus=bus, assume_heat=False)
    return np.array([run.record[joint]["joint_angle"] for joint in servos])


@pytest.mark.long
@pytest.mark.parametrize("servos", [
    {"shoulder": ("dynamixel-xl430-w250", {}), "elbow": ("dynamixel-xl330-m288", {})},
    {"shoulder": ("dynamixel-xl330-m288", {}), "elbow": ("dynamixel-xl430-w250", {})},
    {"shoulder": ("dynamixel-xl330-m288", {"supply.bridge_drop_resistance": None}),
     "elbow": ("dynamixel-xl330-m288", {})},
], ids=["XL430 and XL330", "XL330 and XL430", "drops of their own"])
def test_servos_on_a_stiff_supply_move_as_on_their_own(servos):
    """A robot of XL430 and XL330 was refused, and every servo had the bridge of the first one."""
    made = {joint: model(name, **changes) for joint, (name, changes) in servos.items()}
    own, shared = moved(made, None), moved(made, st.Supply(open_circuit_voltage=VOLTS))
    assert np.ptp(own, axis=1).min() > 0.2
    np.testing.assert_allclose(shared, own, atol=1e-6)


def test_numbers_that_only_some_have_are_told():
    some = of_one_form([model("dynamixel-xl430-w250"), model("dynamixel-xl330-m288")])
    found = differing(some, ["shoulder", "elbow"])
    assert found["friction.load_friction_motor"][1] == st.load_servo("dynamixel-xl330-m288").friction.load_friction
    assert found["supply.bridge_drop_resistance"][0] == 0.0
    with pytest.raises(InputError, match="elbow"):
        differing([model("dynamixel-xl330-m288", **{"gear.backlash": 0.01, "gear.output_inertia": 1e-6}),
                   model("dynamixel-xl330-m288")], ["shoulder", "elbow"])

"""The paper's servo at a joint: as `simulate` has it, beyond what a supply allows."""

import mujoco
import numpy as np
import pytest

import servotwin as st

pytestmark = pytest.mark.long

INERTIA = 0.004
JOINT = f"""<mujoco><option timestep="0.0005" gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 1 0"/>
  <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/></body></worldbody></mujoco>"""


def test_it_moves_as_simulated_alone():
    servo = st.load_servo("hitec-hs-755hb")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(JOINT), {"j": st.AveragedServo(servo)})
    data = mujoco.MjData(drive.model)
    drive.command(data, {"j": 0.0})
    drive.record(data)
    drive.step(data)
    drive.command(data, {"j": 0.6})
    drive.step(data, 1000)
    found = drive.result(data)["j"]
    alone = st.simulate(st.AveragedServo(servo), st.signals.step(0.0, 0.6, at=0.0005, unit="rad"), duration=0.6,
                        load=st.loads.Inertia(INERTIA), output_times=found.time[1:-1])
    np.testing.assert_allclose(found["joint_angle"][1:-1], alone["output_angle"], atol=2e-5)
    assert found["armature_voltage"].max() > 6.0  # volts, of its supply, which it does not know
    np.testing.assert_allclose(found["armature_voltage"][1:-1], alone["armature_voltage"], atol=2e-3)

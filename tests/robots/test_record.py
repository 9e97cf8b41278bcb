"""Records of drives as tables, temperatures that are assumed and said, and what cannot be pickled."""

import copy
import pickle

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import links, servo
from servotwin.errors import InputError

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
ANALOG, DIGITAL = servo(st.PulseServo), servo(st.DigitalServo)


def moved(servos, **more):
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(links()), servos, **more)
    data = mujoco.MjData(drive.model)
    drive.record(data)
    drive.command(data, {"elbow": 1.0, "shoulder": 0.4})
    drive.step(data, 60)
    return drive, data


@pytest.mark.long
def test_a_record_becomes_tables():
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    drive, data = moved({"shoulder": DIGITAL, "elbow": ANALOG})
    record = drive.result(data)
    frame, cube = record.to_dataframe(), record.to_xarray()
    assert frame.shape[0] == 60
    assert np.array_equal(frame["elbow"]["armature_current"], record["elbow"]["armature_current"])
    assert np.array_equal(frame.index, record.time)
    assert np.array_equal(cube["joint_angle"].sel(joint="shoulder"), record["shoulder"]["joint_angle"])
    assert cube["armature_current"].attrs["units"] == "A"
    assert np.isnan(cube["trip"].sel(joint="elbow")).all()  # an analog servo has none
    assert (cube["trip"].sel(joint="shoulder") == 0.0).all()


@pytest.mark.long
def test_temperatures_are_assumed_by_mass_and_that_is_said():
    drive, data = moved({"shoulder": DIGITAL, "elbow": ANALOG})
    assert (drive.look(data, "winding_temperature") > 298.15).all()
    words = "thermal numbers of shoulder, elbow are assumed by the servo's mass"
    assert words in drive.check(data)
    assert words in drive.result(data).notes
    cold, other = moved({"shoulder": DIGITAL, "elbow": ANALOG}, assume_heat=False)
    assert np.isnan(cold.look(other, "winding_temperature")).all()
    assert not cold.result(other).notes
    np.testing.assert_allclose(other.qpos, data.qpos, atol=2e-4)  # a warm winding is a little weaker


@pytest.mark.long
def test_temperatures_that_are_not_known_are_said():
    nameless = st.PulseServo(st.servo_from_values("mine", {
        group: {name.partition(".")[2]: ANALOG.servo.get(name) for name in ANALOG.servo.names()
                if name.startswith(group)}
        for group in ("motor", "gear", "friction", "electronics", "potentiometer", "supply", "stops")}))
    drive, data = moved({"shoulder": nameless, "elbow": ANALOG})
    assert np.isnan(drive.look(data, "winding_temperature")).tolist() == [True, False]
    assert any(note.startswith("temperatures of shoulder are not known") for note in drive.check(data))


@pytest.mark.long(but="dumps-<lambda>1")
@pytest.mark.parametrize("make", [lambda: moved({"elbow": ANALOG, "shoulder": ANALOG})[0],
                                  lambda: st.VectorSimulator(ANALOG, 2)])
@pytest.mark.parametrize("call", [pickle.dumps, copy.copy, copy.deepcopy])
def test_what_cannot_be_pickled_says_so(make, call):
    with pytest.raises(InputError, match=r"pickling or copying of a \w+: allowed: its .*save"):
        call(make())

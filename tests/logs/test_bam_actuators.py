"""BAM's actuators: each with its own gain, those without a duty refused, and no key of a file lost without a word."""

import json
import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, UnknownNameError
from servotwin.identification import BamConvention, read_bam_log, read_bam_parameters, write_bam_parameters
from servotwin.identification.fitting.search.case import with_loop_gain
from servotwin.logs import BAM_ACTUATORS
from servotwin.logs.bam_logs import bam_name_of

PLANT = {"kt": 1.2, "R": 2.5, "armature": 0.02, "friction_viscous": 0.03, "friction_base": 0.05, "model": "m1"}
# duty per radian and unit of the gain, and the largest duty, as BAM's code has them
DUTY = {"mx64": (0.158, 0.9625), "mx106": (0.158, 0.9625), "xl320": (0.05048199, 1.0),
        "xl330": (4096 / (2 * math.pi) / (256 * 885), 1.0), "xc330m288t": (0.00575504, 1.0),
        "sts3215": (0.166, 0.97), "waveshare_st3025": (0.166, 1.0)}
DRIVEN = {"xl330i": "current", "erob80_50": "current", "erob80_100": "current", "feetech_hls": "current",
          "sts3250": "torque", "unitree_go1": "torque"}
# as published (github.com/Rhoban/bam)
STS3215 = {"kt": 1.2652576224140986, "error_gain_ratio": 1.179917121362492, "R": 2.4723714900674616,
           "armature": 0.02335771893803744, "q_offset": -0.06594814555776674, "max_velocity": 5.071148781184456,
           "command_delay": 0.004944939195123091, "friction_base": 0.05185523033166987,
           "friction_stribeck": 0.011100113067732035, "load_friction_base": 0.20787198380836144,
           "load_friction_stribeck": 4.889373048017924e-05, "dtheta_stribeck": 0.4432191636630576,
           "alpha": 9.985595141530244, "friction_viscous": 0.03382996203412605, "model": "m4", "actuator": "sts3215"}
EROB_100 = {"kt": 7.657864604656686, "armature": 0.9589533917163041, "friction_base": 5.610965892410754,
            "friction_viscous": 8.392324354671375, "model": "m1", "actuator": "erob80_100"}
HLS = {"kt": 1.5174411494322464, "armature": 0.002621604009522529, "q_offset": -0.0925165067694887,
       "command_delay": 1.3151429110474344e-09, "friction_base": 0.05071401352829752,
       "load_friction_base": 0.016197087573837577, "friction_viscous": 2.8010130222705035e-09, "R": 7.5,
       "current_limit": 1.37, "model": "m3", "actuator": "feetech_hls"}


@pytest.fixture
def file(tmp_path):
    def write(content, name="own.json"):
        path = tmp_path / name
        path.write_text(json.dumps(content), encoding="utf-8")
        return path
    return write


def raw(**more):
    rows = [{"timestamp": 0.01 * k, "position": 0.0, "goal_position": 0.5, "torque_enable": True} for k in range(5)]
    return {"mass": 0.5, "length": 0.1, "kp": 16, "vin": 7.4, "motor": "sts3215", "trajectory": "", "entries": rows,
            **more}


def refused(read, *args, **options):
    with pytest.raises(InputError) as caught:
        read(*args, **options)
    said = str(caught.value)
    assert said.isprintable()
    return said


def test_every_actuator_is_tried_here():
    assert set(BAM_ACTUATORS) == {*DUTY, *DRIVEN}
    assert {name: one.sets for name, one in BAM_ACTUATORS.items() if one.error_gain is None} == DRIVEN


@pytest.mark.parametrize("actuator", DUTY)
def test_each_actuator_has_its_own_gain_and_largest_duty(file, actuator):
    gain, duty = DUTY[actuator]
    servo = read_bam_parameters(file({**PLANT, "actuator": actuator}), gain=32, voltage=12.0)
    assert servo.firmware.proportional_gain == pytest.approx(32 * gain, rel=1e-7)
    assert servo.firmware.duty_limit == duty
    assert "bam/" in servo.source("firmware.proportional_gain").source
    e = servo.electronics
    assert e.stretcher_gain * e.one_shot_slope / e.frame_period == pytest.approx(32 * gain, rel=1e-7)
    log = read_bam_log(file(raw(motor=actuator), "log.json"))
    assert log.parameters["electronics.stretcher_gain"] == pytest.approx(0.5 * e.stretcher_gain, rel=1e-7)
    found = with_loop_gain(log, st.DigitalServo(servo.replace({
        "firmware.compute_delay": 0.0, "firmware.angle_quantum": 1e-3})))
    assert found.parameters["firmware.proportional_gain"] == pytest.approx(16 * gain, rel=1e-7)


def test_the_sts3215_holds_as_hard_as_bams(file):
    """It was 67 times too soft: the XL330's gain stood for all."""
    servo = read_bam_parameters(file({**PLANT, "actuator": "sts3215"}), gain=32, voltage=7.4)
    model = st.DigitalServo(servo.replace({"firmware.compute_delay": 0.0, "firmware.angle_quantum": 1e-4}))
    held = st.simulate(model, st.signals.constant(0.0, unit="rad"), duration=1.0, load=st.loads.Constant(1.0))
    # V = 0.166 k_P e V_in carries the torque but for what friction carries
    stiff = 1.2 / 2.5 * 0.166 * 32 * 7.4
    assert 0.95 / stiff - 2e-4 <= abs(float(held["output_angle"][-1])) <= 1.05 / stiff + 2e-4


def test_the_numbers_of_a_fit_reach_the_loop(file, tmp_path):
    servo = read_bam_parameters(file(STS3215), gain=32, voltage=7.4)
    firmware = servo.firmware
    assert firmware.proportional_gain == pytest.approx(32 * 0.166 * STS3215["error_gain_ratio"], rel=1e-12)
    assert (firmware.bus_latency, firmware.speed_limit) == (STS3215["command_delay"], STS3215["max_velocity"])
    assert servo.source("firmware.bus_latency").origin == "identified"
    assert servo.notes == "Not used of the file: q_offset (it turns the rig's gravity: a pendulum hangs at -q_offset)."
    log = with_loop_gain(read_bam_log(file(raw(), "log.json")), st.DigitalServo(servo.replace({
        "firmware.compute_delay": 0.0, "firmware.angle_quantum": 1e-3})))
    assert log.parameters["firmware.proportional_gain"] == pytest.approx(0.5 * firmware.proportional_gain, rel=1e-12)
    write_bam_parameters(servo, tmp_path / "again.json")
    again = json.loads((tmp_path / "again.json").read_text())
    assert {**again, "friction_stribeck": pytest.approx(again["friction_stribeck"], rel=1e-9)} == STS3215
    without = {key: value for key, value in STS3215.items() if key != "max_velocity"}
    assert read_bam_parameters(file(without)).firmware.speed_limit == pytest.approx(3400 * 2 * math.pi / 4096)


def test_a_goal_counts_when_the_delay_is_over(file):
    now, later = ({**PLANT, "actuator": "sts3215", **more} for more in ({}, {"command_delay": 0.008}))
    begins = []
    for content in (now, later):
        servo = read_bam_parameters(file(content), gain=32, voltage=7.4)
        model = st.DigitalServo(servo.replace({"firmware.compute_delay": 0.0, "firmware.angle_quantum": 1e-4}))
        result = st.simulate(model, st.signals.step(0.0, 0.3, at=0.05, unit="rad"), duration=0.2,
                             output_times=np.arange(0.0, 0.2, 1e-4))
        begins.append(result.time[np.flatnonzero(np.abs(result["output_angle"]) > 1e-3)[0]])
    assert begins[1] - begins[0] == pytest.approx(0.008, abs=1.1e-3)


@pytest.mark.parametrize("actuator", ["", "sts3216", "STS 3215"])
def test_an_unknown_actuator_has_no_gain(file, actuator):
    path = file({**PLANT, "actuator": actuator})
    assert read_bam_parameters(path).firmware.proportional_gain is None
    said = refused(read_bam_parameters, path, gain=32, voltage=7.4)
    assert "actuator, to which a gain belongs" in said
    assert "sts3215" in said
    assert "BamConvention(error_gain=" in said
    mine = read_bam_parameters(path, gain=32, voltage=7.4, convention=BamConvention(error_gain=0.1))
    assert mine.firmware.proportional_gain == pytest.approx(3.2)
    if actuator:
        log = file(raw(motor=actuator), "log.json")
        assert "motor, to which the gain kp belongs" in refused(read_bam_log, log)
        assert "stretcher_gain" in str(dict(read_bam_log(log, convention=BamConvention(error_gain=0.1)).parameters))


@pytest.mark.parametrize("actuator", DRIVEN)
def test_where_bam_sets_no_duty_a_gain_is_refused(file, actuator):
    path = file({**PLANT, "actuator": actuator, "max_velocity": 3.0, "command_delay": 0.002})
    servo = read_bam_parameters(path, voltage=12.0)
    assert (servo.firmware.proportional_gain, servo.firmware.duty_limit, servo.firmware.speed_limit) == (None,) * 3
    assert (servo.firmware.bus_latency, servo.supply.open_circuit_voltage) == (0.002, 12.0)
    assert servo.notes == (f"Not used of the file: max_velocity (of {actuator} BAM sets the {DRIVEN[actuator]}, "
                           "and no duty).")
    said = refused(read_bam_parameters, path, gain=3)
    assert f"gain of {actuator}" in said
    assert f"sets its {DRIVEN[actuator]}" in said
    with pytest.raises(InputError, match="no duty belongs to a gain"):
        BamConvention.of(actuator)
    log = read_bam_log(file(raw(motor=actuator), "log.json"))
    assert dict(log.parameters) == {"supply.open_circuit_voltage": 7.4}
    assert log.conditions["gain"] == 16.0


def test_an_actuator_without_resistance_says_so(file):
    said = refused(read_bam_parameters, file(EROB_100))
    assert ": R: got 'nothing', allowed: the resistance of the motor" in said
    assert "erob80_100" in said
    assert read_bam_parameters(file({**EROB_100, "R": 1.07})).motor.torque_constant == EROB_100["kt"]


def test_no_key_is_lost_without_a_word(file, tmp_path):
    content = {**HLS, "fitted_by": "me", "seed": 3, "runs": ["a", "b"], "mirror": None, "spread": -0.1}
    servo = read_bam_parameters(file(content))
    for key in ("q_offset", "current_limit", "fitted_by", "seed", "runs", "mirror", "spread"):
        assert f"{key} (" in servo.notes
    assert servo.notes.count("(not known here)") == 5
    assert "command_delay" not in servo.notes
    assert dict(servo.sheet["bam"]) == {"model": "m3", "actuator": "feetech_hls", "q_offset": HLS["q_offset"],
                                        "command_delay": HLS["command_delay"], "current_limit": 1.37,
                                        "fitted_by": "me", "seed": 3.0, "spread": -0.1}
    servo.save(tmp_path / "servo.toml")
    assert st.load_servo(tmp_path / "servo.toml") == servo
    plain = read_bam_parameters(file({**PLANT, "actuator": "mx64"}))
    assert plain.notes == ""


@pytest.mark.parametrize(("more", "words"), [
    ({"command_delay": 0.03}, ("command_delay", "0.015", "frame_period")),
    ({"command_delay": -1.0}, ("command_delay", "-1.0")),
    ({"command_delay": "soon"}, ("command_delay", "'soon'")), ({"max_velocity": None}, ("max_velocity",)),
    ({"error_gain_ratio": math.inf}, ("error_gain_ratio",)), ({"current_limit": "x"}, ("current_limit",)),
    ({"q_offset": [1]}, ("q_offset",)), ({"max_velocity": 0.0}, ("speed_limit",)),
    ({"error_gain_ratio": 0.0}, ("error_gain_ratio", "positive")),
])
def test_bad_numbers_of_the_loop_are_told_in_one_line(file, more, words):
    path = file({**PLANT, "actuator": "sts3215", **more})
    said = refused(read_bam_parameters, path, gain=32, voltage=7.4)
    assert all(word in said for word in words), said
    assert str(path) in said


def test_a_long_delay_wants_longer_frames(file):
    path = file({**PLANT, "actuator": "sts3215", "command_delay": 0.03})
    servo = read_bam_parameters(path, gain=32, convention=BamConvention(error_gain=0.166, frame_period=5e-3))
    assert servo.firmware.bus_latency == 0.03


def test_servos_of_the_catalog_are_written_by_bams_names(tmp_path):
    named = {name: bam_name_of(name) for name in st.catalog_names() if bam_name_of(name)}
    assert named == {"dynamixel-mx-64": "mx64", "dynamixel-mx-106": "mx106", "dynamixel-xl-320": "xl320",
                     "dynamixel-xl330-m077": "xl330", "dynamixel-xl330-m288": "xl330",
                     "feetech-sts3215-7v4": "sts3215", "feetech-sts3215-12v": "sts3215"}
    write_bam_parameters(st.load_servo("dynamixel-mx-64"), tmp_path / "out.json")
    assert json.loads((tmp_path / "out.json").read_text())["actuator"] == "mx64"
    servo = read_bam_parameters(tmp_path / "out.json", gain=32, voltage=12.0)
    assert servo.firmware.proportional_gain == pytest.approx(32 * 0.158)


def test_an_unknown_name_is_told_the_known_ones():
    with pytest.raises(UnknownNameError, match="did you mean 'sts3215'"):
        BamConvention.of("sts3216")

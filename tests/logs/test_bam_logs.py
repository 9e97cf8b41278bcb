"""Logs and parameter files of BAM, in and out, and BAM's servo as a pulse servo."""

import json
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

import servotwin as st
from servotwin.errors import InputError, OutputExistsError, ParameterError
from servotwin.identification import (
    BamConvention,
    Log,
    read_bam_log,
    read_bam_parameters,
    read_logs,
    write_bam_log,
    write_bam_parameters,
)
from servotwin.physics import gear_friction_budget

MOTOR = {"kt": 0.3, "R": 2.5, "armature": 0.002, "friction_viscous": 0.015, "friction_base": 0.01}
STRIBECK = {"friction_stribeck": 0.004, "dtheta_stribeck": 0.2, "alpha": 1.3}
DIRECTIONAL = {"load_friction_motor": 0.2, "load_friction_external": 0.25, "load_friction_motor_stribeck": 0.03,
               "load_friction_external_stribeck": 0.1}
FRICTION = {
    "m1": {}, "m2": STRIBECK, "m3": {"load_friction_base": 0.25},
    "m4": {**STRIBECK, "load_friction_base": 0.25, "load_friction_stribeck": 0.05},
    "m5": {**STRIBECK, **DIRECTIONAL},
    "m6": {**STRIBECK, **DIRECTIONAL, "load_friction_motor_quad": 0.006, "load_friction_external_quad": 0.004},
}


def parameters(model):
    return {**MOTOR, **FRICTION[model], "q_offset": -0.01, "model": model, "actuator": "xl330"}


def entries(n=5, **more):
    return [{"timestamp": 0.005 * k, "position": 0.1 * k, "speed": 20.0, "goal_position": 0.5, "input_volts": 7.3,
             "load": 3, "temp": 39, "torque_enable": True, **more} for k in range(n)]


def raw(**more):
    return {"mass": 0.49, "length": 0.1, "kp": 100, "vin": 7.4, "motor": "xl330", "trajectory": "sin_sin",
            "entries": entries(), **more}


@pytest.fixture
def file(tmp_path):
    def write(content, name="run.json"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return path
    return write


def refused(read, path, *words, **options):
    with pytest.raises(InputError) as caught:
        read(path, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text
    assert text.count(str(path)) == 1, text


def bam_budget(p, motor, external, speed):
    """Friction of Duclusaud et al., 2025, as its equations say it; viscous term left out [N m]."""
    S = math.exp(-abs(speed / p["dtheta_stribeck"]) ** p["alpha"]) if "alpha" in p else 0.0
    budget = p["friction_base"] + S * p.get("friction_stribeck", 0.0)
    through = abs(external - motor)
    budget += p.get("load_friction_base", 0.0) * through + S * p.get("load_friction_stribeck", 0.0) * through
    if "load_friction_motor" in p:
        budget += abs(p["load_friction_external"] * external - p["load_friction_motor"] * motor)
        budget += S * abs(p["load_friction_external_stribeck"] * external - p["load_friction_motor_stribeck"] * motor)
    if "load_friction_motor_quad" in p and np.sign(motor) != np.sign(external):
        budget += S * (p["load_friction_external_quad"] * external**2 * (abs(motor) > abs(external))
                       + p["load_friction_motor_quad"] * motor**2 * (abs(motor) < abs(external)))
    return budget


# ---------------------------------------------------------------------------------------- raw logs

def test_a_raw_log_is_read(file):
    log = read_bam_log(file(raw()))
    assert (log.name, log.motion, log.command_kind, log.command_hold) == ("run", "sin_sin", "angle", "previous")
    assert dict(log.conditions) == {"gain": 100.0, "voltage": 7.4, "motor": "xl330"}
    assert set(log.measured) == {"output_angle", "output_speed", "bus_voltage"}
    assert log.torque_on is None
    assert log.parameters["supply.open_circuit_voltage"] == 7.4
    np.testing.assert_array_equal(log.command, 0.5)
    np.testing.assert_array_equal(log.measured["bus_voltage"], 7.3)


@pytest.mark.parametrize("arm", [None, 0.0, 0.07])
def test_the_pendulum_is_a_point_on_a_rod(file, arm):
    load = read_bam_log(file(raw(**({} if arm is None else {"arm_mass": arm})))).load
    a = arm or 0.0
    assert load.total_inertia == pytest.approx((0.49 + a / 3.0) * 0.1**2, rel=1e-14)
    q = np.linspace(-3.0, 3.0, 7)
    # gravity pulls the shaft to 0: positive torques push towards -q
    np.testing.assert_allclose(load.external_torque(np.zeros(7), q),
                               (0.49 + a / 2.0) * 9.80665 * 0.1 * np.sin(q), rtol=1e-14)


@pytest.mark.parametrize("arm", [0.0, 0.07, 1.5])
def test_what_is_written_is_read_back(file, tmp_path, arm):
    content = raw(arm_mass=arm, entries=[*entries(3), *({**e, "timestamp": 1.0 + e["timestamp"] / 3.0,
                                                         "torque_enable": False} for e in entries(4))])
    content["entries"][4]["goal_position"] = None  # no pulse
    log = read_bam_log(file(content))
    assert np.flatnonzero(np.isnan(log.command)).tolist() == [4]
    path = tmp_path / "again" / "run.json"
    path.parent.mkdir()
    write_bam_log(log, path)
    again = read_bam_log(path)
    for name in ("time", "command", "torque_on"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
    for name in ("output_angle", "output_speed", "bus_voltage"):
        np.testing.assert_array_equal(again.measured[name], log.measured[name])
    assert (dict(again.conditions), again.motion, dict(again.parameters)) == (
        dict(log.conditions), log.motion, dict(log.parameters))
    assert again.load.total_inertia == pytest.approx(log.load.total_inertia, rel=1e-12)
    assert again.load.gravity[0] == pytest.approx(log.load.gravity[0], rel=1e-12)
    assert json.loads(path.read_text())["arm_mass"] == pytest.approx(arm, abs=1e-12)
    with pytest.raises(OutputExistsError):
        write_bam_log(log, path)


def test_what_bam_has_no_place_for_is_not_written(file, tmp_path):
    good = read_bam_log(file(raw()))
    base = {"name": "x", "time": good.time, "command": good.command, "command_kind": "angle", "load": good.load,
            "measured": dict(good.measured), "conditions": dict(good.conditions)}
    holed = np.r_[np.nan, good.measured["output_angle"][1:]]
    for more, word in [
        ({"command": np.full(5, 1e-3), "command_kind": "pulse_width"}, "angle, previous"),
        ({"command_hold": "linear"}, "angle, previous"), ({"conditions": {"gain": 3.0}}, "conditions, voltage"),
        ({"measured": {"output_angle": holed}}, "output_angle"),
        ({"measured": {"feedback_voltage": np.zeros(5)}}, "output_angle"),
        ({"load": st.loads.Inertia(1e-3)}, "one pendulum"),
        ({"load": good.load + st.loads.Inertia(1e-3)}, "one pendulum"),
        ({"load": st.loads.Pendulum(mass=0.1, length=0.1, hanging_angle=1.0)}, "hanging at 0"),
        ({"load": st.loads.Pendulum(mass=0.1, length=0.1, inertia=1.0)}, "point mass on a rod"),
    ]:
        with pytest.raises(InputError, match=word):
            write_bam_log(Log(**{**base, **more}), tmp_path / "out.json")
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize(("content", "words"), [
    (b"", ("empty file",)), (b"[1, 2", ("line 1 is not valid JSON",)), ([1], ("list", "entries")),
    ({"entries": 3}, ("entries",)), (raw(mass="heavy"), ("mass", "'heavy'")), (raw(kp=0), ("firmware gain", "0.0")),
    (raw(vin=None), ("vin", "nothing")), (raw(length=-0.1), ("length", "at least 0")),
    (raw(motor=3), ("motor", "text")),
    (raw(entries=[]), ("0 samples",)), (raw(entries=entries(2)), ("2 samples",)),
    (raw(entries=[*entries(3), 4]), ("entry 3", "an object")),
    (raw(entries=[*entries(3), {"timestamp": 9.0}]), ("entry 3, goal_position", "nothing")),
    (raw(entries=entries(4, position="far")), ("entry 0, position", "'far'")),
    (raw(entries=entries(4, position=math.nan)), ("entry 0, position", "nan")),
    (raw(entries=entries(4, timestamp=1.0)), ("stands still at sample 1",)),
    (raw(entries=entries(4)[::-1]), ("runs backwards at sample 1",)),
    (raw(entries=entries(4, goal_position=4000.0)), ("4000 rad", "degrees or counts?")),
    (raw(entries=entries(4, torque_enable=0.5)), ("torque_on", "0.5")),
    (raw(vin=0.0), ("supply.open_circuit_voltage", "positive")),
])
def test_what_is_wrong_in_a_log_is_said_in_one_line(file, content, words):
    if content != raw(entries=entries(4, torque_enable=0.5)):
        refused(read_bam_log, file(content), *words)
        return
    assert not read_bam_log(file(content)).torque_on.any()  # half of it is not all of it


junk = some.recursive(some.none() | some.booleans() | some.floats() | some.text(max_size=4) | some.integers(),
                      lambda inner: some.lists(inner, max_size=3), max_leaves=5)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(top=some.dictionaries(some.sampled_from([*raw(), "arm_mass"]), junk, max_size=2),
       entry=some.dictionaries(some.sampled_from([*entries()[0]]), junk, max_size=2), at=some.integers(0, 4))
def test_almost_right_logs_are_read_or_refused(file, top, entry, at):
    rows = entries()
    rows[at] = {**rows[at], **entry}
    path = file({**raw(entries=rows), **top})
    for read in (read_bam_log, read_logs):
        try:
            read(path)
        except InputError as error:
            said = str(error)
        else:
            continue
        assert said.isprintable()


# ---------------------------------------------------------------------------------------- parameter files

@pytest.mark.parametrize("model", [*FRICTION])
def test_the_friction_is_that_of_the_model(file, model):
    p = parameters(model)
    servo = read_bam_parameters(file(p))
    f = servo.friction
    shares = {name: getattr(f, name) or 0.0 for name in (
        "load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
        "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad")}
    if f.load_friction is not None:  # M3 and M4: one share for both
        shares |= dict.fromkeys(("load_friction_motor", "load_friction_external"), f.load_friction)
        shares |= dict.fromkeys(("load_friction_motor_stribeck", "load_friction_external_stribeck"),
                                f.load_friction_stribeck or 0.0)
    for motor, external, speed in [(0.5, -0.3, 0.1), (0.2, -0.6, -0.05), (0.5, 0.3, 0.3), (-0.4, 0.4, 1.0)]:
        budget = gear_friction_budget(
            speed, motor, external, coulomb_torque=f.coulomb_torque_forward, breakaway_ratio=f.breakaway_ratio or 1.0,
            stribeck_speed=f.stribeck_speed, stribeck_exponent=f.stribeck_exponent or 1.0, **shares)
        assert budget == pytest.approx(bam_budget(p, motor, external, speed), rel=1e-12)
    assert (servo.motor.torque_constant, servo.motor.back_emf_constant, servo.gear.gear_reduction) == (0.3, 0.3, 1.0)
    assert (servo.motor.rotor_inertia, servo.motor.motor_viscous_friction) == (0.002, 0.015)
    assert dict(servo.sheet["bam"]) == {"model": model, "actuator": "xl330", "q_offset": -0.01}
    assert servo.source("motor.torque_constant").origin == "identified"
    assert "run.json" in servo.source("friction.coulomb_torque_forward").source
    assert servo.source("electronics.frame_period").origin == "assumed"


@pytest.mark.parametrize(("more", "gain", "speed"), [
    ({}, 200 * 0.166, None), ({"error_gain_ratio": 1.2, "max_velocity": 5.1}, 200 * 0.166 * 1.2, 5.1)])
def test_the_loop_of_bam_is_a_firmware(file, more, gain, speed):
    convention = BamConvention(error_gain=0.166, frame_period=2e-3, largest_duty=0.97)
    servo = read_bam_parameters(file({**parameters("m3"), **more}), gain=200, voltage=7.4, convention=convention)
    firmware = servo.firmware
    assert firmware.proportional_gain == pytest.approx(gain, rel=1e-14)
    assert (firmware.speed_limit, firmware.control_period, firmware.duty_limit) == (speed, 2e-3, 0.97)
    off = {name for name in vars(firmware) if getattr(firmware, name) is not None}
    assert off == {"proportional_gain", "control_period", "duty_limit", "command_kind"} | (
        {"speed_limit"} if speed else set())
    assert read_bam_parameters(file(parameters("m3"))).firmware.proportional_gain is None


@pytest.mark.parametrize("model", [*FRICTION])
def test_parameters_that_are_written_are_read_back(file, tmp_path, model):
    servo = read_bam_parameters(file(parameters(model)), gain=200, voltage=7.4)
    write_bam_parameters(servo, tmp_path / "out.json")
    written = json.loads((tmp_path / "out.json").read_text())
    assert {k: v for k, v in written.items() if k != "friction_stribeck"} == {
        k: v for k, v in parameters(model).items() if k != "friction_stribeck"}
    assert written.get("friction_stribeck", 0.0) == pytest.approx(
        parameters(model).get("friction_stribeck", 0.0), rel=1e-12)
    servo.save(tmp_path / "servo.toml")
    assert st.load_servo(tmp_path / "servo.toml") == servo


def test_a_geared_servo_is_written_at_its_output(servo, tmp_path):
    servo = servo.replace({"motor.back_emf_constant": servo.motor.torque_constant})
    write_bam_parameters(servo, tmp_path / "out.json", model="m5", actuator="hs755")
    written = json.loads((tmp_path / "out.json").read_text())
    N = servo.gear.gear_reduction
    assert written["kt"] == pytest.approx(N * servo.motor.torque_constant, rel=1e-12)
    assert written["armature"] == pytest.approx(N**2 * servo.motor.rotor_inertia, rel=1e-12)
    assert written["friction_base"] == pytest.approx(N * servo.friction.coulomb_torque_forward, rel=1e-12)
    assert (written["model"], written["actuator"], written["q_offset"]) == ("m5", "hs755", 0.0)
    again = read_bam_parameters(tmp_path / "out.json")
    assert again.friction.breakaway_ratio == pytest.approx(servo.friction.breakaway_ratio or 1.0, rel=1e-12)


def test_what_bam_cannot_hold_is_not_written(file, tmp_path):
    servo = read_bam_parameters(file(parameters("m4")))
    for values, word, error in [
        ({"motor.back_emf_constant": 0.31}, "one k_t", InputError),
        ({"friction.coulomb_torque_backward": 0.02}, "both ways", InputError),
        ({"motor.armature_resistance": None}, "armature_resistance", ParameterError),
        ({"friction.stribeck_speed": None, "friction.stribeck_exponent": None}, "stribeck_speed", ParameterError),
    ]:
        with pytest.raises(error, match=word):
            write_bam_parameters(servo.replace(values), tmp_path / "out.json")
    for model, word in [("m2", "m4, which knows it"), ("m7", "auto, m1")]:
        with pytest.raises(InputError, match=word):
            write_bam_parameters(servo, tmp_path / "out.json", model=model)
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize(("content", "words"), [
    ([1], ("list",)), ({"kt": 1.0}, ("dict", "model")), ({**parameters("m1"), "model": "m7"}, ("model", "m1, m2")),
    ({**parameters("m1"), "model": [1]}, ("model",)), ({**parameters("m1"), "kt": "x"}, ("kt", "'x'")),
    ({**parameters("m1"), "kt": 0}, ("motor.torque_constant", "positive")),
    ({**parameters("m1"), "friction_base": -0.1}, ("friction_base", "at least 0")),
    ({k: v for k, v in parameters("m6").items() if k != "alpha"}, ("alpha", "nothing")),
    ({**parameters("m1"), "alpha": 1.0}, ("alpha", "no such number in model m1")),
    ({**parameters("m5"), "load_friction_base": 0.1}, ("load_friction_base", "model m5")),
    ({**parameters("m2"), "friction_base": 0.0}, ("friction_base", "more than 0")),
    ({**parameters("m1"), "actuator": 3}, ("actuator", "a text")),
])
def test_what_is_wrong_in_parameters_is_said_in_one_line(file, content, words):
    refused(read_bam_parameters, file(content), *words)


# ---------------------------------------------------------------------------------------- the servo as pulses

@pytest.mark.parametrize(("gain", "error"), [(100, 0.5), (100, -1.2), (400, 0.5), (800, 1.0), (400, -2.9), (50, 3.1)])
def test_the_mean_voltage_of_a_locked_shaft_is_that_of_bam(file, gain, error):
    convention = BamConvention()
    model = st.PulseServo(read_bam_parameters(file(parameters("m1")), gain=gain, voltage=7.4))
    command = st.signals.constant(error, unit="rad")
    result = st.simulate(model, command, duration=0.1, load=st.loads.Coulomb(1e3), initial={"output_angle": 0.0})
    assert np.abs(result["output_speed"]).max() == 0.0
    # 50 whole frames, on a grid a thousand times finer
    t = 0.03 + (np.arange(50_000) + 0.5) * convention.frame_period / 1000
    mean = 7.4 * np.clip(gain * convention.error_gain * error, -1.0, 1.0)
    assert result.at("armature_voltage", t).mean() == pytest.approx(mean, abs=7.4 * 2e-3)


def test_the_bounded_servo_has_the_same_voltage(file):
    model = st.BoundedServo(read_bam_parameters(file(parameters("m1")), gain=100, voltage=7.4))
    g = 4096 / (2 * math.pi) / (256 * 885)  # of the XL330, in BAM's code
    for error, duty in [(0.5, 50 * g), (-3.0, -300 * g), (5.0, 1.0)]:
        result = st.simulate(model, st.signals.constant(error, unit="rad"), duration=0.1, load=st.loads.Coulomb(1e3),
                             initial={"output_angle": 0.0}, output_times=[0.05])
        assert result["armature_voltage"][0] == pytest.approx(7.4 * duty, rel=1e-9)


def integrated(p, log, convention, dt=5e-5):
    """BAM's law by small steps: mean voltage, held for a frame; Coulomb friction as the impulse that stops."""
    q, w = float(log.measured["output_angle"][0]), 0.0
    held = np.searchsorted(log.time - log.start, np.arange(round(log.duration / dt)) * dt + 1e-12, side="right") - 1
    command, frame, J = log.command[held], round(convention.frame_period / dt), p["armature"] + log.load.total_inertia
    path = []
    for k in range(held.size):
        path.append(q)
        if k % frame == 0:
            duty = min(max(log.conditions["gain"] * convention.error_gain * (command[k] - q), -1.0), 1.0)
        motor = p["kt"] * (log.conditions["voltage"] * duty - p["kt"] * w) / p["R"]
        external = -log.load.gravity[0] * math.sin(q)
        budget = bam_budget(p, motor, external, w) + p["friction_viscous"] * abs(w)
        stop = J / dt * w + motor + external
        w += (motor + external - math.copysign(min(abs(stop), budget), stop)) / J * dt
        q += w * dt
    return np.interp(log.time - log.start, np.arange(held.size) * dt, path)


@pytest.mark.long
@pytest.mark.parametrize("model", ["m1", "m3", "m6"])
def test_a_pendulum_is_lifted_as_bam_says(file, model):
    p, convention = parameters(model), BamConvention(frame_period=5e-4)
    time = np.arange(0.0, 0.7, 0.005)
    rows = [{"timestamp": t, "position": 0.0, "goal_position": 1.2 * min(t / 0.4, 1.0), "torque_enable": True}
            for t in time.tolist()]
    log = read_bam_log(file(raw(kp=200, entries=rows)), convention=convention)
    servo = read_bam_parameters(file(p, "p.json"), convention=convention).replace(dict(log.parameters))
    result = st.simulate(st.PulseServo(servo), log.signal(), duration=log.duration, load=log.load,
                         output_times=log.time, initial={"output_angle": 0.0, "output_speed": 0.0})
    reference = integrated(p, log, convention)
    assert reference.max() > 0.4
    assert np.sqrt(np.mean((result["output_angle"] - reference) ** 2)) < 5e-3


@pytest.mark.parametrize("values", [{"error_gain": 0.0}, {"frame_period": -1.0}, {"centre": 1.0}, {"centre": "x"},
                                    {"largest_duty": 1.1}])
def test_a_convention_that_cannot_be(values):
    with pytest.raises(InputError, match="BamConvention"):
        BamConvention(**values)


# ---------------------------------------------------------------------------------------- measured data

def test_the_measured_logs_are_read(data_folder):
    logs = read_logs(data_folder / "bam_xl330" / "raw")
    assert {log.conditions["gain"] for log in logs} == {100.0, 200.0, 800.0}
    assert {log.motion for log in logs} == {"sin_sin", "lift_and_drop", "up_and_down", "sin_time_square"}
    for log in logs:
        assert log.duration == pytest.approx(6.0, abs=0.02)
        assert log.load.total_inertia == pytest.approx(0.0049, rel=1e-12)
        assert (log.torque_on is None) == (log.motion != "lift_and_drop")
        assert not log.is_constant
        # the servo reports its speed too: it is the slope of its angle
        q, w = log.measured["output_angle"], log.measured["output_speed"]
        assert np.corrcoef(np.gradient(q, log.time), w)[0, 1] > 0.8
    dropped = next(log for log in logs if log.motion == "lift_and_drop")
    (lifted,) = dropped.without_torque_off()
    assert lifted.duration == pytest.approx(2.0, abs=0.02)

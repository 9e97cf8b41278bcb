"""Registers that logs do not record: assumed of a robot, and found by whole lanes."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from servotwin.identification import validate
from servotwin.identification.fitting.registers import as_logs_say, of_no_robot, register_search
from servotwin.identification.fitting.search.stopping import Within
from servotwin.logs.bam_logs import read_bam_log
from servotwin.models import default_model
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.table import known_registers

STS = "feetech-sts3215-7v4"


def log(joint="elbow_flex", robot="so101_follower", **more):
    t = np.linspace(0.0, 0.5, 26)
    return st.Log(name=f"{joint} of {robot or 'none'}", time=t, command_kind="angle",
                  command=np.where(t < 0.1, 0.0, 0.2),
                  measured={"output_angle": 0.2 * (1.0 - np.exp(-t / 0.1))},
                  conditions={"joint": joint, **({"robot": robot} if robot else {}), **more})


@pytest.mark.parametrize(("logs", "servo", "registers"), [
    ([log()], STS, "lerobot"), ([log(robot="so100")], STS, "lerobot"), ([log("gripper")], STS, "lerobot-gripper"),
    ([log("gripper"), log()], STS, "lerobot"), ([log(robot="koch_follower")], STS, None), ([log(robot="")], STS, None),
    ([log(), log(robot="so100")], STS, None), ([log()], "dynamixel-xl330-m288", None),
    ([log()], "hitec-hs-755hb", None),
])
def test_the_registers_follow_from_the_robot(logs, servo, registers):
    model = default_model(st.load_servo(servo))
    found, said = as_logs_say(model, logs)
    if registers is None:
        assert found is model
        assert said == ()
        return
    assert found.servo.firmware == st.feetech_sts(registers, servo=servo).firmware
    gain = found.servo.source("firmware.proportional_gain")
    assert gain.origin == "assumed"
    assert "P_Coefficient (21) = 16 assumed" in gain.source
    assert said == (f"registers assumed as LeRobot writes them for {logs[0].conditions['robot']} (set {registers}), "
                    "not the factory's",)


def test_a_servo_whose_registers_were_written_keeps_them():
    model = st.DigitalServo(st.feetech_sts({"P_Coefficient": 20}, servo=STS))
    assert as_logs_say(model, [log()]) == (model, ())
    factory = st.DigitalServo(st.load_servo(STS))
    assert as_logs_say(factory, of_no_robot([log()])) == (factory, ())


@pytest.mark.long
def test_validate_says_it():
    found = validate([log()], st.load_servo(STS))
    assert found.warnings[0].startswith("registers assumed as LeRobot writes them for so101_follower (set lerobot)")
    assert found.servo.firmware.proportional_gain == pytest.approx(16 / (4000 * 2 * math.pi / 4096))
    said = validate([log()], st.feetech_sts({"P_Coefficient": 20}, servo=STS))
    assert not any("registers" in text for text in said.warnings)


X = "dynamixel-xl430-w250"
CHANGES = {STS: st.feetech_sts, X: st.dynamixel_x}


def recorded(servo, *, seconds=6.0, seed=0):
    """Return a log of a servo whose encoder counts: sudden moves of an inertia, 50 rows a second."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, 0.02)
    goals = np.repeat(rng.uniform(-0.8, 0.8, 1 + int(seconds / 0.6)), 30)[:len(t)]
    goals[:10] = goals[10] = 0.0
    load = st.loads.Inertia(2e-3)
    run = st.simulate(st.DigitalServo(servo), st.signals.samples(t, goals, unit="rad"), load=load, duration=t[-1],
                      output_times=t)
    count = 2.0 * math.pi / 4096.0
    return st.Log(name="moves", time=t, command=goals, command_kind="angle", load=load,
                  measured={"output_angle": count * np.round(run["output_angle"] / count)})


@pytest.mark.parametrize(("name", "registers", "numbers"), [
    (STS, {"P_Coefficient": 16, "D_Coefficient": 32, "Acceleration": 254, "Maximum_Acceleration": 254}, {}),
    pytest.param(STS, {"D_Coefficient": 0}, {"firmware.acceleration_limit": None}, marks=pytest.mark.long),
    pytest.param(STS, {"P_Coefficient": 48, "Acceleration": 20}, {}, marks=pytest.mark.long),
    (X, {"Position_P_Gain": 1500, "Position_D_Gain": 600}, {}),
    pytest.param(X, {"Profile_Acceleration": 20, "Profile_Velocity": 100}, {}, marks=pytest.mark.long),
])
def test_registers_that_nobody_recorded_are_found(name, registers, numbers):
    plain = st.load_servo(name)
    true = CHANGES[name](registers, servo=name)
    true = true.replace(numbers) if numbers else true
    found = register_search(st.DigitalServo(plain), [recorded(true)])
    count = math.degrees(2.0 * math.pi / 4096.0)
    assert found.taken is not None
    assert math.degrees(found.best[0].error) < 3.0 * count < 0.5 * math.degrees(found.given.error)
    for number in ("proportional_gain", "acceleration_limit"):
        said, wanted = (getattr(one.firmware, number) for one in (found.taken.servo, true))
        assert said == wanted or said == pytest.approx(wanted, rel=0.1)
    assert "registers that nobody recorded are not as the servo file has them" in found.sentences[0]


def test_what_is_right_stays():
    servo = st.load_servo(STS)
    found = register_search(st.DigitalServo(servo), [recorded(servo)])
    assert (found.taken, found.best, found.sentences) == (None, (), ())


@pytest.mark.parametrize("model", [
    st.PulseServo(st.load_servo("hitec-hs-755hb")), st.DigitalServo(st.load_servo("jx-pdi-6221mg"))])
def test_servos_without_registers_have_none_to_search(model):
    assert register_search(model, [log(robot="")]) is None


@pytest.mark.long
def test_registers_that_were_given_are_held_and_doubted():
    servo = st.feetech_sts({"P_Coefficient": 32, "Acceleration": 0}, servo=STS)
    assert known_registers(register_family_of(servo), servo) == {"P_Coefficient", "Acceleration"}
    true = st.feetech_sts({"P_Coefficient": 16, "Acceleration": 254, "Maximum_Acceleration": 254}, servo=STS)
    found = register_search(st.DigitalServo(servo), [recorded(true)])
    assert found.taken is None or found.taken.servo.firmware.proportional_gain == servo.firmware.proportional_gain
    assert found.doubted.servo.firmware.proportional_gain == pytest.approx(true.firmware.proportional_gain, rel=0.15)
    assert found.sentences[-1].startswith("the registers that were given are doubtful: as if with")


@pytest.mark.long
def test_a_sheet_is_not_given_up_for_a_register_that_is_doubted():
    """A P of twice the true one, given by the user, bends inertia and friction by over 10 standard errors."""
    given = {"P_Coefficient": 32, "D_Coefficient": 32, "Acceleration": 254, "Maximum_Acceleration": 254}
    servo = st.feetech_sts(given, servo=STS)
    names = [name for group in ("motor", "friction") for name in servo.names() if name.startswith(f"{group}.")
             and isinstance(servo.get(name), float) and servo.get(name) > 0.0]
    sure = {name: replace(servo.source(name), lower=None, upper=None, std=0.02 * servo.get(name)) for name in names}
    log = recorded(st.feetech_sts({**given, "P_Coefficient": 16}, servo=STS))
    fit = st.identify([log], replace(servo, quantities={**servo.quantities, **sure}), starts=1, intervals=False,
                      compare_with=(), diagnose=False)
    assert fit.registers.doubted is not None
    assert fit.yielded == ()
    assert fit.warnings[0].startswith("the registers that were given are doubtful: as if with P_Coefficient 16")


@pytest.mark.long
def test_a_fit_begins_with_the_registers_that_were_found():
    true = st.feetech_sts("lerobot", servo=STS)
    fit = st.identify([recorded(true)], st.load_servo(STS), free=["output_coulomb_torque"], nuisance=("delay",),
                      starts=1, intervals=False, compare_with=(), diagnose=False)
    assert fit.registers.taken is not None
    assert math.degrees(fit.traces[0].error.rms) < 0.1
    assert fit.warnings[0] == fit.registers.sentences[0]


@pytest.mark.long
def test_gains_that_bam_did_not_write_are_not_known(data_folder):
    logs = [part for path in sorted((data_folder / "bam_sts3250").glob("*.json"))
            for part in read_bam_log(path).without_torque_off()]
    assert "kp is what it was told" in logs[0].reading.remarks[0]
    found = validate(logs, st.load_servo("feetech-sts3250"))
    assert math.degrees(found.total) > 5.0
    assert math.degrees(found.registers.taken.error) < 0.5
    assert "no limit of acceleration" in found.warnings[0]


def test_a_search_that_has_no_time_says_nothing():
    servo = st.load_servo(STS)
    assert register_search(st.DigitalServo(servo), [log(robot="")], Within(1e-9)) is None

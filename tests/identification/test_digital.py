"""Digital servos: their firmware and plant from logs, what their registers say, and structures that are compared."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.digital_servos import ON_BUS, PLANT, PULSED, digital_log, off
from identification.fits import near
from servotwin.errors import ServotwinError
from servotwin.identification import Log, Structure, as_structure, compare_structures, identify, validate
from servotwin.identification.fitting.checks import usual_free
from servotwin.identification.fitting.ladder import as_arm
from servotwin.identification.fitting.search.case import GAIN, with_loop_gain
from servotwin.identification.fitting.search.free import nominal

QUICK = {"priors": None, "starts": 1, "compare_with": (), "holdout": 0, "diagnose": False}
MOTIONS = ("step", "prbs", "triangle")
STILL = ("initial_state",)
INERT = st.loads.Inertia(4e-3)
FREE = usual_free(st.DigitalServo(PULSED))[:-1]  # angles that are commanded tell nothing of the scale of pulses


@pytest.fixture(scope="module")
def pulsed():
    return [digital_log(PULSED, motion, seed=k) for k, motion in enumerate(MOTIONS)]


@pytest.fixture(scope="module")
def on_bus():
    return [digital_log(ON_BUS, motion, seed=k, gain=gain, name=f"{motion} {gain}")
            for gain in (1.5, 6.0) for k, motion in enumerate(("step", "triangle"))]


@pytest.mark.long
def test_plant_and_firmware_of_a_servo_with_pulses_are_found(pulsed):
    """What the usual search asks of a digital servo comes back within its intervals, from a start far off."""
    wrong = off(PULSED, {**PLANT, "firmware.proportional_gain": 0.6, "firmware.derivative_gain": 1.8,
                         "firmware.deadband_angle": 0.5})
    fit = identify(pulsed, wrong, free=FREE, nuisance=STILL, **QUICK)
    assert type(fit.model) is st.DigitalServo
    near(fit, servo=PULSED)
    assert fit.noise["output_angle"] == pytest.approx(1e-3, rel=0.3)


@pytest.mark.long
def test_what_is_searched_unless_one_says(pulsed, on_bus):
    """The plant, and of the firmware what neither registers nor logs say."""
    plant = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque")
    assert usual_free(st.DigitalServo(PULSED), pulsed) == (
        *plant, GAIN, "firmware.derivative_gain", "firmware.deadband_angle", "potentiometer.feedback_gain")
    bus = (*plant, "motor.motor_viscous_friction")
    assert usual_free(st.DigitalServo(ON_BUS), on_bus) == bus
    assert usual_free(st.DigitalServo(ON_BUS)) == (*bus, GAIN)
    assert usual_free(st.DigitalServo(st.load_servo("dynamixel-xl330-m288"))) == bus


@pytest.mark.long
def test_the_plant_of_a_bus_servo_is_one_at_all_gains_that_its_logs_say(on_bus):
    fit = identify(on_bus, off(ON_BUS, PLANT), nuisance=STILL, **QUICK)
    assert GAIN not in fit.names
    near(fit, servo=ON_BUS)
    assert fit.noise["output_angle"] == pytest.approx(1e-3, rel=0.3)


@pytest.mark.long
def test_without_a_current_gain_and_voltage_are_one_product():
    """Below its limit the duty acts by k_p V K/R alone."""
    small = [digital_log(ON_BUS, motion, seed=k, reach=0.12) for k, motion in enumerate(("triangle", "step"))]
    servo = ON_BUS.replace({"supply.bridge_drop_voltage": None})
    fit = identify(small, servo, free=[GAIN, "supply.open_circuit_voltage"], nuisance=STILL, **QUICK)
    assert [item.parameters for item in fit.unidentifiable] == [(GAIN, "supply.open_circuit_voltage")]


@pytest.mark.long
def test_ticks_of_every_log_have_a_phase():
    """Ticks of 20 ms, half of them late: with a phase of their own the logs leave noise, without one far more."""
    slow = ON_BUS.replace({"firmware.control_period": 0.02})
    logs = [digital_log(slow, "step", seed=k, std=2e-4, phase=phase) for k, phase in enumerate((0.3, 0.8))]
    free = ["output_torque_constant", "output_inertia"]
    left = {name: identify(logs, slow, free=free, nuisance=name, **QUICK).noise["output_angle"]
            for name in (STILL, (*STILL, "control_phase"))}
    assert left[STILL] > 4.0 * left[*STILL, "control_phase"]
    assert left[*STILL, "control_phase"] == pytest.approx(2e-4, rel=0.3)


@pytest.mark.parametrize(("servo", "log", "expected"), [
    ("dynamixel-xl330-m288", {"gain": 200.0}, 200.0 / (256.0 * 885.0 * 2.0 * math.pi / 4096.0)),
    ("feetech-sts3215-7v4", {"gain": 16.0}, 16.0 * 4096.0 / (4000.0 * 2.0 * math.pi)),
    (ON_BUS, {"gain": 200.0}, 200.0 * st.identification.BamConvention().error_gain),
    (ON_BUS, {}, 200.0 * st.identification.BamConvention().error_gain),
], ids=["dynamixel", "feetech", "convention", "convention alone"])
def test_the_gain_of_a_log_reaches_the_firmware(servo, log, expected):
    made = bam_log(**log)
    model = st.DigitalServo(servo if isinstance(servo, st.Servo) else st.load_servo(servo))
    found = with_loop_gain(made, model)
    assert found.parameters[GAIN] == pytest.approx(expected, rel=1e-9)
    assert found.parameters["supply.open_circuit_voltage"] == 7.4
    assert not any(name.startswith(("electronics.", "potentiometer.")) for name in found.parameters)
    assert with_loop_gain(found, model).parameters == found.parameters


def bam_log(**conditions):
    time = np.arange(0.0, 0.2, 0.01)
    return Log(name="run", time=time, command=np.sin(time), command_kind="angle", measured={"output_angle": time},
               parameters=st.identification.BamConvention().parameters(200.0, 7.4), conditions=conditions)


def test_a_log_of_pulses_keeps_its_parameters():
    log = bam_log(gain=200.0)
    assert with_loop_gain(log, st.DigitalServo(PULSED)) is log


@pytest.mark.long
def test_where_torque_is_off_a_bus_servo_is_not_compared(on_bus):
    log = on_bus[0]
    on = log.time < 1.0
    fell = replace(log, torque_on=on, measured={"output_angle": np.where(on, log.measured["output_angle"], 5.0)})
    assert validate([fell], ON_BUS).traces[0].time[-1] < 1.0
    assert validate([fell], ON_BUS).total < 2e-3


@pytest.mark.parametrize(("free", "nuisance", "words"), [
    (["firmware.angle_quantum"], STILL, "jumps"), (["firmware.off_state"], STILL, "a word"),
    ([GAIN], STILL, "one of both"),
], ids=["a count", "a word", "a gain that logs say"])
def test_what_no_search_can_find_is_refused(on_bus, free, nuisance, words):
    with pytest.raises(ServotwinError, match=words):
        identify(on_bus, ON_BUS, free=free, nuisance=nuisance, **QUICK)


def test_only_digital_servos_have_ticks(pulsed):
    analog = as_structure(PULSED, Structure("analog", "brake"))
    with pytest.raises(ServotwinError, match="without ticks"):
        identify(pulsed, analog, st.PulseServo, free=["output_inertia"], nuisance=("control_phase",), **QUICK)


@pytest.mark.parametrize("tick", [1e-3, 5e-3])
def test_a_delay_is_searched_as_far_as_duties_wait(tick):
    servo = PULSED.replace({"firmware.control_period": tick})
    (found,) = st.identification.Space(st.DigitalServo(servo), ["firmware.compute_delay"]).parameters
    assert found.upper == pytest.approx(min(15.0 * tick, 0.021))


@pytest.mark.parametrize(("name", "value", "limits"), [
    ("firmware.filter_weight", 0.5, (0.02, 1.0)), ("firmware.duty_limit", 0.9, (0.05, 1.0)),
    ("firmware.deadband_angle", 6e-3, (0.0, 0.126)),
    ("firmware.minimum_duty", 0.02, (0.0, 0.5)), (GAIN, 4.0, (0.2, 80.0)),
])
def test_firmware_is_searched_where_it_makes_sense(name, value, limits):
    (found,) = st.identification.Space(st.DigitalServo(PULSED), [name]).parameters
    assert found.start == pytest.approx(value)
    assert (found.lower, found.upper) == pytest.approx(limits, rel=0.1, abs=1e-9)


def test_a_deadband_of_pulses_is_where_that_of_angles_begins():
    servo = PULSED.replace({"firmware.deadband_angle": None, "electronics.deadband": 6e-6})
    assert nominal(servo, "firmware.deadband_angle") == pytest.approx(5e-3)


@pytest.mark.long
def test_structures_are_told_apart_and_the_simplest_is_chosen():
    """A digital servo that brakes: pulses, or a bridge that opens, fit it worse."""
    logs = [digital_log(PULSED, ("step", "triangle")[k % 2], seed=k, duration=0.8) for k in range(6)]
    ladder = compare_structures(logs, PULSED, free=[*FREE, "electronics.stretcher_gain", "electronics.deadband"],
                                rungs=("M1", "M3"), nuisance=STILL, priors=None, starts=1, intervals=False,
                                holdout=[log.name for log in logs[:2]])
    assert [rung.name for rung in ladder.rungs] == [
        "analog, brake, M1", "analog, coast, M1", "digital, brake, M1", "digital, diode, M1", "digital, brake, M3"]
    assert ladder.chosen.startswith("digital, brake")
    assert ladder[ladder.chosen].holdout < 1.5e-3
    assert ladder["digital, diode, M1"].training > ladder["digital, brake, M1"].training
    for other in ("analog, brake, M1", "analog, coast, M1"):
        assert ladder[other].holdout > 2.0 * ladder[ladder.chosen].holdout, other


@pytest.mark.long
def test_a_gear_that_gives_way_is_told_from_a_stiff_one():
    """Of a log of one angle an elastic arm says the same, but for where the motor's friction acts."""
    servo = PULSED.replace({"gear.stiffness": 12.0, "gear.damping": 0.01})
    logs = [digital_log(servo, ("step", "prbs")[k % 2], seed=k, duration=0.8, sample=5e-3, std=2e-4, load=INERT)
            for k in range(4)]
    ladder = compare_structures(logs, PULSED, free=FREE[:4], kinds=("digital",), bridges=("brake",),
                                springs=("gear", "arm"), rungs=("M1",), nuisance=STILL, priors=None, starts=1,
                                intervals=False, holdout=[log.name for log in logs[:2]])
    names = ["digital, brake, M1", "digital, brake, elastic gear, M1", "digital, brake, elastic arm, M1"]
    assert [rung.name for rung in ladder.rungs] == names
    assert ladder.chosen == names[1]
    assert ladder[names[0]].holdout > 5.0 * ladder[names[1]].holdout
    assert ladder.fit.servo.gear.stiffness == pytest.approx(12.0, rel=0.05)


def test_an_arm_that_gives_way_takes_what_turned_with_the_shaft():
    load = as_arm(st.loads.Pendulum(mass=0.3, length=0.2, hanging_angle=0.4) + st.loads.Inertia(1e-3)
                  + st.loads.Constant(0.1))
    body = load.flexible
    assert (load.inertia, load.pendulums, load.torque) == (0.0, (), 0.1)
    assert body.moment_of_inertia == pytest.approx(1e-3 + 0.3 * 0.04)
    assert (body.mass, body.length, body.hanging_angle) == (0.3, 0.2, 0.4)


def test_chip_and_firmware_follow_from_each_other():
    analog = as_structure(PULSED, Structure("analog", "brake"))
    back = as_structure(analog.replace({name: None for name in analog.names() if name.startswith("firmware.")}),
                        Structure("digital", "diode"))
    assert st.PulseServo(analog).servo.electronics.off_state == "brake"
    assert back.firmware.proportional_gain == pytest.approx(PULSED.firmware.proportional_gain)
    assert nominal(back, "firmware.deadband_angle") == pytest.approx(PULSED.firmware.deadband_angle)


@pytest.mark.parametrize(("servo", "more", "words"), [
    (ON_BUS, {"kinds": ("analog",)}, "on a bus"), (PULSED, {"kinds": ("smart",)}, "analog"),
    (PULSED, {"bridges": ("short",)}, "brake"), (PULSED, {"select": "luck"}, "criterion"),
    (PULSED, {"kinds": ("analog",), "bridges": ("diode",)}, "diode"), (PULSED, {"springs": ("belt",)}, "gear, arm"),
], ids=["no pulses", "kind", "bridge", "select", "nothing left", "spring"])
def test_structures_that_make_no_sense_are_refused(servo, more, words):
    with pytest.raises(ServotwinError, match=words):
        compare_structures([digital_log(PULSED, "step")], servo, **more)


@pytest.mark.long
def test_a_log_that_begins_off_its_goal_starts_at_the_side_of_its_play():
    """The motor pushes towards the goal; a log of a load says nothing of it."""
    servo = st.load_servo("feetech-sts3215-12v")
    model, time = st.DigitalServo(servo), np.arange(0.0, 2.0, 0.01)
    goals = np.where(time < 0.5, 0.0, 0.4)
    play, start = servo.get("gear.backlash"), 0.0077
    run = st.simulate(model, st.signals.samples(time, goals, unit="rad"), duration=2.0, output_times=time, initial={
        "output_angle": start, "motor_angle": servo.get("gear.gear_reduction") * (start - 0.5 * play)})
    log = Log(name="off", time=time, command=goals, command_kind="angle",
              measured={"output_angle": run["output_angle"]})

    def worst(log):
        return max(float(np.abs(trace.residual).max()) for trace in validate(log, servo, st.DigitalServo).traces)

    assert worst(log) < 1e-5
    assert worst(replace(log, load=st.loads.Inertia(1e-3))) > 1e-3

"""Elastic gears and elastic arms: against an independent reference, closed forms, limits, balances, and bad input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import servotwin as st
from models.elastic_servos import (
    CASES,
    HELD,
    IDLE,
    SMOOTH,
    STEP,
    STIFF,
    Coulomb,
    Flexible,
    N,
    bodies,
    random_case,
    referred,
    servo,
)
from servotwin.logs import Log

DURATION = 0.5
TIMES = np.linspace(0.0, DURATION, 251)  # every edge of a frame among them
DIGITAL = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0}


def run(name, kind=st.PulseServo, duration=DURATION, times=TIMES, more=None, **words):
    case = CASES[name]
    model = kind(servo(case.changes | (more or {})))
    return st.simulate(model, case.command, duration=duration, load=case.load, output_times=times,
                       initial=case.initial, **words).raise_if_failed()


@pytest.mark.long(but="arm")
@pytest.mark.parametrize("name", CASES)
def test_both_bodies_move_as_the_reference_says(name):
    result = run(name, accuracy=1e-11)
    found = referred(result)
    expected = found.states[:, [0, 2]]
    assert np.ptp(expected, axis=0).min() > 0.2
    assert np.abs(bodies(result) - expected).max() < 1e-10
    assert abs(result.energy.residual) < 1e-9
    if "stop" in name:
        assert result.energy.stops > 1e-4
    if name.startswith("play"):
        assert {"gear meets", "gear parts"} <= {event.kind for event in result.events}
    # The chip measures the output, not the motor: its one-shot at the last edge tells the error.
    q = found.states[:, 0 if result.load.flexibles else 2][TIMES == 0.48]
    width = result["pulse_width"][-1]
    assert result["error_time"][-1] == pytest.approx(float(width - 1.3e-3 * (0.44 * q + 0.5)[0]), abs=1e-12)


@pytest.mark.long(but="1")
@pytest.mark.parametrize("seed", range(8))
def test_a_mixture_of_everything_moves_as_the_reference_says(seed):
    case = random_case(seed)
    result = st.simulate(st.PulseServo(servo(case.changes)), case.command, duration=0.3, load=case.load,
                         output_times=TIMES[:151], accuracy=1e-11).raise_if_failed()
    assert np.abs(bodies(result) - referred(result).states[:, [0, 2]]).max() < 1e-10
    assert abs(result.energy.residual) < 1e-9


LINEAR = {
    "rings": ({"gear.damping": 0.005}, 0.0), "overdamped": ({"gear.damping": 3.0}, 0.0),
    "stiff": ({"gear.stiffness": 3e4, "gear.damping": 0.3}, 0.0), "load on a spring": ({}, 4.0),
    "nearly critical": ({"gear.stiffness": 80.0, "gear.damping": 0.62}, 0.0),
}


@pytest.mark.parametrize("name", LINEAR)
def test_a_braked_linear_pair_moves_by_the_modes_of_its_matrix(name):
    """To rounding, whatever accuracy is asked for: its law is linear, and followed as such."""
    changes, stiffness = LINEAR[name]
    model = st.PulseServo(servo(SMOOTH | IDLE | changes))
    load = st.loads.Inertia(2e-3) + st.loads.Viscous(2e-3) + st.loads.Spring(stiffness)
    start = {"output_angle": 0.1, "output_speed": 2.0, "motor_angle": 0.13 * N, "motor_speed": -1.0 * N}
    times = np.linspace(0.0, 0.2, 81)
    result = st.simulate(model, st.signals.constant(0.1, unit="rad"), duration=0.2, load=load, output_times=times,
                         initial=start, accuracy=1e-5)
    k, c, J1, J2 = model.value("gear.stiffness"), model.value("gear.damping"), 4e-3, 3e-3
    matrix = np.array([
        [0.0, 1.0, 0.0, 0.0], [-k / J1, -(c + 1e-3 + 1.0 / 3.0) / J1, k / J1, c / J1],
        [0.0, 0.0, 0.0, 1.0], [k / J2, c / J2, -(k + stiffness) / J2, -(c + 2e-3) / J2]])
    values, vectors = np.linalg.eig(matrix)
    weights = np.linalg.solve(vectors, [0.13, -1.0, 0.1, 2.0])
    expected = ((vectors[[0, 2]] * weights) @ np.exp(np.outer(values, times))).real.T
    assert np.abs(bodies(result) - expected).max() < 1e-10
    exact = [(expm(t * matrix) @ [0.13, -1.0, 0.1, 2.0])[[0, 2]] for t in times]
    assert np.abs(bodies(result) - exact).max() < 1e-12


@pytest.mark.parametrize("kind", [st.PulseServo, st.DigitalServo])
def test_a_stiffer_gear_comes_nearer_to_a_rigid_one_at_first_order(kind):
    load = st.loads.Inertia(2e-3)  # without friction: what sticks while the gear rings depends on its phase

    def angle(changes):
        model = kind(servo(DIGITAL | SMOOTH | {"electronics.stretcher_gain": 1e4} | changes))
        return st.simulate(model, STEP, duration=0.1, load=load, output_times=[0.1])["output_angle"][0]

    rigid = angle(STIFF)
    off = [abs(angle({"gear.stiffness": k, "gear.damping": 0.5}) - rigid) for k in (2e3, 4e3, 8e3)]
    assert off[0] / off[1] == pytest.approx(2.0, abs=0.02)
    assert off[1] / off[2] == pytest.approx(2.0, abs=0.02)


def test_an_output_rings_on_a_motor_that_stands():
    model = st.PulseServo(servo(IDLE | {"friction.coulomb_torque_forward": 2.0 / N,
                                        "friction.coulomb_torque_backward": 2.0 / N}))
    result = st.simulate(model, HELD, duration=0.3, load=st.loads.Inertia(9e-3),
                         initial={"output_speed": 1.0, "motor_speed": 0.0}, output_step=1e-3)
    decay = 0.5 * 0.02 / 0.01
    omega = math.sqrt(80.0 / 0.01 - decay**2)
    expected = np.exp(-decay * result.time) * np.sin(omega * result.time) / omega
    assert np.all(result["motor_angle"] == 0.0)
    assert np.abs(result["output_angle"] - expected).max() < 1e-10


def test_an_arm_on_a_shaft_that_is_held_rings_at_16_hertz():
    arm = st.loads.Flexible(stiffness=100.0, inertia=0.01)
    model = st.PulseServo(servo(STIFF | IDLE | {"friction.coulomb_torque_forward": 20.0 / N,
                                                "friction.coulomb_torque_backward": 20.0 / N}))
    result = st.simulate(model, HELD, duration=0.4, load=arm, initial={"output_speed": 1.0}, output_step=5e-4)
    stops = next(event.time for event in result.events if event.kind == "stick")
    free = result.time > stops
    swing, t = result["load_angle"][free] - result["output_angle"][-1], result.time[free]
    assert arm.held_frequency == pytest.approx(15.915, abs=1e-3)
    waves = np.array([np.cos(100.0 * t), np.sin(100.0 * t)]).T
    left = np.linalg.lstsq(waves, swing, rcond=None)
    assert np.abs(swing).max() > 5e-3
    assert np.abs(waves @ left[0] - swing).max() < 1e-10


@pytest.mark.long(but="heavy arm-PulseServo-more4")
@pytest.mark.parametrize(("name", "kind", "more"), [
    ("stops", st.PulseServo, {"gear.backlash": 0.02, "gear.damping": 0.3}),
    ("pendulum", st.PulseServo, {"friction.breakaway_ratio": 1.5, "friction.stribeck_speed": 20.0}),
    ("play", st.PulseServoInductive, {"motor.armature_inductance": 1e-3}),
    ("load that sticks", st.PulseServo, {"thermal.winding_capacity": 5.0, "thermal.housing_capacity": 20.0,
                                         "thermal.winding_to_housing": 10.0, "thermal.housing_to_ambient": 10.0}),
    ("heavy arm", st.PulseServo, {"electronics.off_state": "coast"}),
    ("heavy arm", st.DigitalServo, DIGITAL), ("play", st.DigitalServo, DIGITAL)])
def test_no_energy_is_lost_or_made(name, kind, more):
    result = run(name, kind, more=more)
    energy = result.energy
    assert energy.supply > 0.1
    assert energy.friction > 0.01
    assert abs(energy.residual) < 1e-9


def test_momentum_is_kept_between_two_bodies_that_nothing_else_touches():
    changes = SMOOTH | IDLE | {"electronics.off_state": "coast", "motor.motor_viscous_friction": 0.0,
                               "gear.backlash": 0.03, "gear.damping": 0.05}
    result = st.simulate(st.PulseServo(servo(changes)), HELD, duration=0.6, load=st.loads.Inertia(1e-3),
                         initial={"output_speed": 1.0, "motor_speed": 0.0})
    momentum = 4e-3 * result["motor_speed"] / N + 2e-3 * result["output_speed"]
    kinds = [event.kind for event in result.events]
    assert kinds.count("gear meets") > 1
    assert kinds.count("gear parts") > 1
    assert np.abs(momentum - 2e-3).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["play", "heavy arm"])
@pytest.mark.parametrize("kind", [st.PulseServo, st.DigitalServo])
def test_lanes_and_ticks_move_as_one_servo_does(name, kind):
    case, more = CASES[name], DIGITAL if kind is st.DigitalServo else {}
    model, cut = kind(servo(case.changes | more)), [0.0, 0.03, 0.1, 0.1234, 0.3]
    result = run(name, kind, 0.3, cut, more)
    signals = [signal for signal in result.names if signal != "time"]
    assert ("load_angle" in signals) == (name == "heavy arm")
    batch = st.simulate_many(model, case.command, duration=0.3, load=case.load, output_times=cut, outputs=signals,
                             parameters={"load.torque": [0.0, case.load.torque]})
    sim = st.Simulator(model, load=case.load)
    state = sim.initial(case.command)
    for k, time in enumerate(cut):
        state = sim.advance(state, time, case.command)
        for signal in signals:
            value, near = result[signal][k], 1e-9 * (1.0 + abs(result[signal][k]))
            assert batch[signal][1, k] == pytest.approx(value, abs=near), signal
            if time not in (0.0, 0.1, 0.3):  # at an edge a state is seen before what happens there
                assert sim.observe(state, signal, case.command) == pytest.approx(value, abs=near), signal
    ticks = st.VectorSimulator(model, lanes=2, load=case.load)
    ticks.reset(command_angle=0.0)
    ticks.advance(0.02, command_angle=0.0)
    for _ in range(28):
        ticks.advance(0.01, command_angle=math.radians(40.0))
    for signal in ("output_angle", "motor_speed", *signals[-3:]):
        assert ticks[signal][1] == pytest.approx(result[signal][-1], abs=1e-9 * (1.0 + abs(result[signal][-1])))


@pytest.mark.long
def test_a_measured_angle_of_the_load_is_compared():
    case, both = CASES["arm"], ("output_angle", "load_angle")
    result = run("arm", times=np.linspace(0.0, DURATION, 101))
    log = Log(name="arm", time=result.time, command=result["pulse_width"], command_kind="pulse_width", load=case.load,
              measured={name: result[name] for name in both})
    softer = Flexible(stiffness=70.0, inertia=0.01, damping=0.01) + Coulomb(0.02)
    same, other = (st.validate([one], servo(case.changes), sensors=both).noise
                   for one in (log, replace(log, load=softer)))
    assert same.keys() == set(both)
    assert max(same.values()) < 1e-8
    assert other["load_angle"] > 1e-4


@pytest.mark.slow
def test_what_is_imposed_keeps_the_twist():
    sims = st.VectorSimulator(st.PulseServo(servo({})), lanes=1, load=st.loads.Inertia(2e-3))
    sims.reset(command_angle=0.0)
    for _ in range(5):
        sims.advance(0.01, command_angle=0.5)
    twist = sims["motor_angle"] / N - sims["output_angle"]
    sims.set(output_angle=0.2, output_speed=0.0)
    assert sims["output_angle"][0] == 0.2
    assert abs(twist[0]) > 1e-4
    assert sims["motor_angle"] / N - sims["output_angle"] == pytest.approx(twist, abs=1e-14)
    assert sims["motor_speed"][0] > 100.0
    sims.set(parameters={"gear.stiffness": 40.0})
    sims.advance(0.01)
    assert np.isfinite(sims["output_angle"]).all()


@pytest.mark.parametrize(("build", "words"), [
    (lambda: servo({"gear.stiffness": -1.0}), ("gear.stiffness", "-1", "positive")),
    (lambda: servo({"gear.stiffness": None}), ("gear.damping", "only together with gear.stiffness")),
    (lambda: st.simulate(st.PulseServo(servo({"gear.output_inertia": 0.0})), STEP, duration=0.1),
     ("gear.stiffness", "gear.output_inertia")),
    (lambda: st.simulate_many(st.PulseServo(servo({})), STEP, duration=0.1, parameters={
        "gear.output_inertia": [1e-3, 0.0]}), ("gear.stiffness", "lane 1", "gear.output_inertia")),
    (lambda: st.simulate(st.PulseServo(servo({})), STEP, duration=0.1,
                         load=st.loads.Flexible(stiffness=1.0, inertia=1e-3)), ("load.flexible", "gear.stiffness")),
    (lambda: st.simulate(st.PulseServo(servo(STIFF | {"gear.backlash": 0.01})), STEP, duration=0.1,
                         load=st.loads.Flexible(stiffness=1.0, inertia=1e-3)), ("load.flexible", "gear.backlash")),
    (lambda: st.simulate(st.GearedMotor(servo({"motor.armature_inductance": 1e-3})), st.signals.constant(1.0, unit="V"),
                         duration=0.1, load=st.loads.Flexible(stiffness=1.0, inertia=1e-3)),
     ("load.flexible of GearedMotor", "PulseServo")),
    (lambda: st.simulate_bus({"one": (st.PulseServo(servo({})), STEP)}, supply=st.Supply(open_circuit_voltage=6.0),
                             duration=0.1), ("'one'", "gear.stiffness", "supply")),
    (lambda: st.VectorSimulator(st.PulseServo(servo({})), lanes=1, bus=st.Supply(open_circuit_voltage=6.0)),
     ("lane 0", "gear.stiffness", "supply"))])
def test_what_cannot_be_is_said_in_one_line(build, words):
    with pytest.raises(st.errors.ServotwinError) as caught:
        build()
    text = str(caught.value)
    assert "\n" not in text
    for word in words:
        assert word in text


def test_other_models_name_the_spring_as_ignored():
    names = {"gear.stiffness", "gear.damping"}
    model = st.GearedMotor(servo({"motor.armature_inductance": 1e-3}))
    assert names <= set(model.ignored)
    assert not names & set(st.PulseServo(servo({})).ignored)

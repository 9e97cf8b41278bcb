"""Frames of the pulse servo by the clock: when it drives, what ends a drive, and what happens at one instant."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, InputError
from servotwin.models.state.noise import gaussian
from servotwin.models.terms import frame
from servotwin.models.terms.frame import AT_START, Decision, Frame

DEGREE = math.pi / 180.0
MOTOR = dict(armature_resistance=3.0, torque_constant=1.0, back_emf_constant=1.0, rotor_inertia=5e-3,
             motor_viscous_friction=0.0)
CHIP = dict(stretcher_gain=50.0, deadband=8e-6, one_shot_slope=1e-3, one_shot_offset=1e-3, off_state="brake",
            frame_period=0.02)


def servo(motor=None, friction=0.2, supply=None, stops=None, **electronics):
    return st.PulseServo(st.servo_from_values("pulsed", {
        "motor": MOTOR | (motor or {}), "gear": {"gear_reduction": 1.0},
        "friction": {"coulomb_torque_forward": friction, "coulomb_torque_backward": friction},
        "electronics": CHIP | electronics, "potentiometer": {"feedback_gain": 0.5},
        "supply": {"open_circuit_voltage": 6.0} | (supply or {}), "stops": stops or {}}))


HELD = st.loads.Coulomb(1e3)  # nothing moves: the errors stay what they were


def drives(result):
    """Return [(start, end, sign)] of all drives."""
    found, start = [], None
    for event in result.events:
        if event.kind.startswith("drive"):
            if start is not None:
                found.append((start[0], event.time, start[1]))
            sign = {"drive forward": 1, "drive backward": -1, "drive ends": 0}[event.kind]
            start = (event.time, sign) if sign else None
    return found


def held(model, command, duration=0.1):
    return drives(st.simulate(model, command, duration=duration, load=HELD, initial={"output_angle": 0.0}))


def test_a_drive_starts_when_the_longer_pulse_ends_and_lasts_as_the_stretcher_says():
    # T_os = 1 ms; 1.104 ms: u = 100 us, 5 ms from 1.104 ms on; 0.896 ms: the same backward, from 1 ms on
    assert held(servo(), st.signals.constant(1104.0, unit="us"), 0.03) == [
        pytest.approx((1.104e-3, 6.104e-3, 1), rel=1e-12), pytest.approx((21.104e-3, 26.104e-3, 1), rel=1e-12)]
    assert held(servo(), st.signals.constant(896.0, unit="us"), 0.03) == [
        pytest.approx((1e-3, 6e-3, -1), rel=1e-12), pytest.approx((21e-3, 26e-3, -1), rel=1e-12)]


@pytest.mark.parametrize(("error", "driven"), [(3.999, 0), (4.0, 0), (4.001, 1), (-3.999, 0), (-4.001, -1)])
def test_the_deadband_is_the_full_width(error, driven):
    found = held(servo(one_shot_offset=1e-3), st.signals.constant(1000.0 + error, unit="us"), 0.015)
    assert [sign for _, _, sign in found] == ([driven] if driven else [])


def test_minimum_drive_and_rc_stretcher():
    command = st.signals.constant(1104.0, unit="us")
    (first, end, _), = held(servo(minimum_drive_time=1e-3), command, 0.015)
    assert end - first == pytest.approx(1e-3 + 50.0 * 100e-6, rel=1e-10)
    (first, end, _), = held(servo(stretcher_time_constant=0.02), command, 0.015)
    assert end - first == pytest.approx(0.02 * math.log1p(5e-3 / 0.02), rel=1e-10)


def test_full_drive_has_no_gaps_and_the_next_decision_replaces_it():
    # 1.5 ms asks for 24.8 ms of drive in frames of 20 ms; then 1 ms: the decision says nothing
    command = st.signals.step(1500.0, 1000.0, at=0.05, unit="us")
    assert held(servo(), command, 0.2) == [pytest.approx((1.5e-3, 0.061, 1), rel=1e-12)]
    back = st.signals.step(1500.0, 600.0, at=0.05, unit="us")
    assert held(servo(), back, 0.075)[:1] == [pytest.approx((1.5e-3, 0.061, 1), rel=1e-12)]


def test_the_width_is_read_at_the_edge():
    command = st.signals.ramp(1104.0, 1204.0, at=0.0, over=0.02, unit="us")
    (start, _, _), (later, _, _) = held(servo(), command, 0.04)
    assert start == pytest.approx(1.104e-3, rel=1e-12)
    assert later == pytest.approx(0.02 + 1.204e-3, rel=1e-12)


def test_the_frame_belongs_to_the_transmitter():
    command = st.signals.constant(1104.0, unit="us", frame_period=0.01)
    assert [start for start, _, _ in held(servo(), command, 0.039)] == pytest.approx(
        [1.104e-3, 11.104e-3, 21.104e-3, 31.104e-3])
    train = st.signals.pulse_train([-0.01, 0.003, 0.019, 0.05], [1104.0] * 4)
    assert [start for start, _, _ in held(servo(), train, 0.2)] == pytest.approx([4.104e-3, 20.104e-3, 51.104e-3])


def test_a_refused_pulse_decides_nothing_and_the_drive_goes_on():
    model = servo(pulse_width_min=900e-6, pulse_width_max=1.6e-3)
    train = st.signals.pulse_train([0.0, 0.02, 0.04], [1600.0, 300.0, 1700.0])
    result = st.simulate(model, train, duration=0.1, load=HELD, initial={"output_angle": 0.0})
    # 1.6 ms is within (bounds included): u = 596 us, 29.8 ms
    assert drives(result) == [pytest.approx((1.6e-3, 31.4e-3, 1), rel=1e-10)]
    assert [event.time for event in result.events if event.kind == "pulse refused"] == [0.02, 0.04]


def test_the_timeout_ends_a_drive_and_a_valid_edge_restarts_the_clock():
    model = servo(pulse_timeout=0.012, stretcher_gain=500.0)
    train = st.signals.pulse_train([0.0, 0.01, 0.019], [1104.0, 1104.0, 2900.0])
    limited = servo(pulse_timeout=0.012, stretcher_gain=500.0, pulse_width_max=2.5e-3)
    assert held(limited, train)[-1][1] == pytest.approx(0.022, rel=1e-12)  # the refused edge does not restart it
    assert held(model, train)[-1][1] == pytest.approx(0.031, rel=1e-12)
    late = servo(pulse_timeout=0.5e-3)  # over before the decision
    assert held(late, st.signals.constant(1104.0, unit="us")) == []


def test_no_pulses_no_drive():
    assert held(servo(), st.signals.pulse_train([-0.5], [1500.0]), 0.3) == []


def test_two_decisions_can_wait():
    # T_os = 10 ms: frames of 6 ms start before the one before has been decided
    model = servo(one_shot_offset=10e-3, frame_period=6e-3, stretcher_gain=0.5)
    found = held(model, st.signals.constant(3000.0, unit="us"), 0.03)
    assert found == [pytest.approx((start, start + 0.5 * (7e-3 - 4e-6), -1), rel=1e-10)
                     for start in (0.010, 0.016, 0.022)]


def test_three_decisions_cannot_wait():
    model = servo(one_shot_offset=10e-3, frame_period=3e-3)
    result = st.simulate(model, st.signals.constant(2000.0, unit="us"), duration=0.05, load=HELD,
                         initial={"output_angle": 0.0})
    assert result.status is st.Status.CROWDED
    assert result.ended == pytest.approx(6e-3)


def test_a_decision_that_comes_first_replaces_the_one_that_waits():
    waits = Decision(5.0, 1.0, 1.0, 1e-3)
    chip = servo().chip()
    before = Frame(3, 3, 0.0, math.inf, math.inf, 0, 0.0, waits, frame.NOTHING)
    now = frame.edge(chip, before, 2.0, 1.2e-3, 0.0, 0.0, 0.0, 0)
    assert now.pending.time == pytest.approx(2.0012)
    assert now.later == frame.NOTHING
    assert now.number == 4


def test_at_one_instant_a_drive_ends_before_a_decision_starts_one():
    now = Frame(1, 1, 1.0, 1.0, math.inf, 0, 0.0, Decision(1.0, -1.0, 0.5, -2e-4), frame.NOTHING)
    after = frame.switched(now, 1.0)
    assert (after.drive, after.drive_end, after.error) == (-1.0, 1.5, -2e-4)
    assert frame.switched(AT_START, 0.0) == AT_START


def test_coupling_of_motor_voltage_and_supply_into_the_one_shot():
    # driven and held: i = 2 A, v_m = 6 - 0.4*2 = 5.2 V with R_b = 0.4, so v_eff = v_o + 0.01*5.2 + 0.02*(-0.8)
    model = servo(motor={"armature_resistance": 2.6}, supply={"internal_resistance": 0.4}, stretcher_gain=1e3,
                  back_emf_injection=0.01, supply_coupling=0.02)
    result = st.simulate(model, st.signals.constant(1504.0, unit="us"), duration=0.03, load=HELD,
                         initial={"output_angle": 0.0})
    errors = result.at("error_time", [0.015, 0.025])
    assert errors[0] == pytest.approx(504e-6, rel=1e-12)
    assert errors[0] - errors[1] == pytest.approx(1e-3 * (0.01 * 5.2 - 0.02 * 0.8), rel=1e-9)
    assert result.at("bus_voltage", [0.025])[0] == pytest.approx(5.2, rel=1e-12)
    assert result.at("supply_current", [0.025])[0] == pytest.approx(2.0, rel=1e-12)


def test_noise_is_one_draw_a_frame_and_follows_the_seed():
    model = st.PulseServo(servo().servo.replace({"potentiometer.noise": 5e-3}))
    command = st.signals.constant(1000.0, unit="us")

    def errors(seed):
        return st.simulate(model, command, duration=1.0, load=HELD, initial={"output_angle": 0.0}, seed=seed,
                           output_times=np.arange(50) * 0.02 + 0.015)["error_time"]

    np.testing.assert_allclose(errors(3), [-5e-6 * gaussian(3, k) for k in range(50)], rtol=1e-9, atol=1e-18)
    assert not np.array_equal(errors(3), errors(4))


def test_states_go_on_in_the_middle_of_a_frame():
    model = st.PulseServo(servo().servo.replace({"potentiometer.noise": 2e-3}))
    command = st.signals.sine(mean=0.4, amplitude=0.3, frequency=3.0, unit="rad")
    sim = st.Simulator(model, load=st.loads.Constant(0.1), seed=5)
    whole = sim.advance(sim.initial(command), 0.5, command)
    state = sim.initial(command)
    for instant in np.sort(np.random.default_rng(2).uniform(0.0, 0.5, 300)):
        state = pickle.loads(pickle.dumps(sim.advance(state, float(instant), command)))
    state = sim.advance(state, 0.5, command)
    np.testing.assert_allclose(state.values, whole.values, rtol=0.0, atol=1e-12)
    assert state.memory.chip.drive == whole.memory.chip.drive
    assert state.memory.chip.number == whole.memory.chip.number


def test_bounces_at_a_stop_die_out():
    model = servo(friction=0.0, stops={"lower_angle": -1.0, "upper_angle": 0.5, "restitution": 0.8}, off_state="coast")
    train = st.signals.pulse_train([0.0], [1900.0])
    result = st.simulate(model, train, duration=20.0, load=st.loads.Constant(-0.05),
                         initial={"output_angle": 0.0}).raise_if_failed()
    assert result["output_angle"][-1] == 0.5
    assert result["output_speed"][-1] == 0.0
    assert (np.diff([e.time for e in result.events]) >= 0.0).all()
    assert 10 < sum(event.kind == "upper stop" for event in result.events) < 200


def test_a_load_that_friction_just_holds_does_not_move():
    for torque in (0.2, -0.2):
        result = st.simulate(servo(), st.signals.pulse_train([-1.0], [1000.0]), duration=100.0, output_step=1.0,
                             load=st.loads.Constant(torque), initial={"output_angle": 0.3})
        assert (result["output_angle"] == 0.3).all()
        assert len(result.events) == 0


def test_a_drive_that_friction_just_holds_does_not_move():
    # full voltage at rest gives 2 N m
    result = st.simulate(servo(friction=2.0), st.signals.constant(1500.0, unit="us"), duration=1.0,
                         initial={"output_angle": 0.0})
    assert (result["output_angle"] == 0.0).all()


def test_coasting_without_friction_keeps_its_speed():
    model = servo(friction=0.0, off_state="coast")
    result = st.simulate(model, st.signals.pulse_train([-1.0], [1000.0]), duration=2.0,
                         initial={"output_angle": 0.0, "output_speed": 3.0})
    np.testing.assert_allclose(result["output_angle"], 3.0 * result.time, rtol=1e-13)
    assert (result["armature_current"] == 0.0).all()
    np.testing.assert_allclose(result["armature_voltage"], 3.0, rtol=1e-13)


def test_coasting_too_fast_feeds_the_source():
    # beyond 6.4 rad/s the diodes conduct: i = -(w - 6.4)/(R_a + R_b)
    model = servo(friction=0.0, off_state="coast", supply={"bridge_drop_voltage": 0.4, "internal_resistance": 0.5})
    result = st.simulate(model, st.signals.pulse_train([-1.0], [1000.0]), duration=0.001,
                         initial={"output_angle": 0.0, "output_speed": 9.9})
    assert result["armature_current"][0] == pytest.approx(-3.5 / 3.5, rel=1e-12)
    assert result["supply_current"][0] == pytest.approx(-1.0, rel=1e-12)
    assert result["bus_voltage"][0] == pytest.approx(6.5, rel=1e-12)


def test_the_brush_drop_ends_electric_braking():
    model = servo(friction=0.0, motor={"brush_drop_voltage": 0.5})
    result = st.simulate(model, st.signals.pulse_train([-1.0], [1000.0]), duration=1.0,
                         initial={"output_angle": 0.0, "output_speed": 5.0})
    assert result["output_speed"][-1] == pytest.approx(0.5, rel=1e-6)  # below 0.5 V no current flows
    assert result["armature_current"][0] == pytest.approx(-4.5 / 3.0, rel=1e-12)


@pytest.mark.parametrize("command", [
    st.signals.constant(25000.0, unit="us"), st.signals.constant(1500.0, unit="us", frame_period=1e-3),
    st.signals.constant(-3.0, unit="rad")])
def test_what_is_no_pulse_is_refused_at_once(command):
    with pytest.raises(CommandError, match=r"pulse width.* us"):
        st.simulate(servo(), command, duration=0.1)


def test_a_coasting_bridge_has_no_mean_voltage():
    with pytest.raises(InputError, match="coasts"):
        servo(off_state="coast").averaged()
    with pytest.warns(UserWarning, match="minimum_drive_time"):
        servo(minimum_drive_time=1e-3).averaged()


def test_the_averaged_servo_has_the_same_stiffness():
    model = servo(friction=0.0, frame_period=1e-3)  # frames so short that the mean is all there is
    averaged = model.averaged()
    load = st.loads.Constant(0.5) + st.loads.Viscous(0.5)
    command = st.signals.constant(1400.0, unit="us", frame_period=2e-3)
    sag = [st.simulate(m, command, duration=3.0, load=load)["output_angle"][2000:].mean()
           for m in (model, model.averaged(2e-3))]
    start = model.start_angle(1.4e-3)
    assert sag[0] - start == pytest.approx(sag[1] - start, rel=0.02)
    assert averaged.value("electronics.bridge_gain") == pytest.approx(6.0 * 50.0 / (1e-3 * 1e3), rel=1e-12)

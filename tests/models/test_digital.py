"""The digital servo: its law to the integer, its profile, its trips, its bridge, and what it keeps."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, InputError, MissingParameterError, ParameterError

from .digital_servos import COUNT, LOCKED, SMOOTH, digital, feetech, goal, standing

# P, dead zone, startup force, errors in counts, duties in thousandths: measured on an STS3215
TABLE = [
    (32, 1, 0, (3, 4, 5, 6, 8, 9), (16, 24, 32, 40, 56, 64)), (32, 1, 16, (2, 3, 4, 5), (24, 32, 40, 48)),
    (50, 0, 16, (1, 2, 3), (28, 41, 53)), (50, 1, 16, (2, 3, 4), (28, 41, 53)),
    (32, 0, 0, (1, 2, 3, 4), (8, 16, 24, 32)),
    (32, 1, 16, (75, 85, 90, 95, 100), (608, 688, 728, 768, 808)),
]


@pytest.mark.parametrize(("P", "zone", "startup", "errors", "duties"), TABLE)
def test_duty_at_rest_is_that_of_the_maker_to_the_integer(P, zone, startup, errors, duties):
    for sign in (1, -1):
        found = [1000.0 * standing(feetech(P, zone, startup), goal(sign * e), 0.02)["duty"][-1] for e in errors]
        np.testing.assert_allclose(found, sign * np.array(duties), rtol=0.0, atol=1e-9)


def test_a_rising_count_leaves_the_filtered_angle_one_low():
    shafts = {10: 10, 11: 10}  # it comes from 10 counts
    for count, seen in shafts.items():
        model = feetech(32, 0, 0)
        sim = st.Simulator(model)
        state = sim.initial(goal(40), initial={"output_angle": 10 * COUNT})
        state = sim.advance(state, 0.0105, goal(40))
        point = state.memory.point
        y = point.y._replace(q=count * COUNT)
        moved = state.memory._replace(point=point._replace(y=y, anchor=y, anchor_time=math.inf, wiper=y.q))
        state = sim.advance(type(state)(state.time, state.places, moved, state.numbers), 0.05, goal(40))
        assert 1000.0 * sim.observe(state, "duty", goal(40)) == pytest.approx(8 * (40 - seen), abs=1e-9)


def test_overload_trips_at_tick_2000_and_lets_go_below_its_output():
    model = feetech(32, 1, 16)
    command = st.signals.samples([0.0, 3.0, 3.5], [100 * COUNT, 50 * COUNT, 23 * COUNT], unit="rad", hold="previous")
    result = standing(model, command, 4.0)
    duty, trip = 1000.0 * result["duty"], result["trip"]
    np.testing.assert_allclose(duty[[1, 1999, 2000, 2999, 3002, 3499, 3502]], [808, 808, 200, 200, 200, 200, 192])
    assert trip[[1999, 2000, 3499, 3502]].tolist() == [0, 1, 1, 0]
    assert [(round(e.time, 9), e.kind) for e in result.events if "trip" in e.kind] == [
        (2.0, "trips by overload"), (3.5, "trip ends")]


@pytest.mark.long(but="50.0-ticks0")
@pytest.mark.parametrize(("v_0", "ticks"), [(50.0, (20, 35, 108, 400, 1056)), (0.0, (38, 57, 133, 429, 1099))])
def test_profile_arrives_at_the_tick_of_the_makers(v_0, ticks):
    for counts, tick in zip((1, 2, 10, 100, 600), ticks, strict=True):
        model = feetech(32, 1, 16, overload_duty=1.0, speed_limit=1000 * COUNT, acceleration_limit=2000 * COUNT,
                        minimum_speed=v_0 * COUNT)
        reference = standing(model, goal(counts), 1.2)["reference_angle"] / COUNT
        assert int(np.argmax(np.abs(reference - counts) < 1e-6)) == tick - 1


def test_a_goal_that_moves_in_mid_profile_is_overshot_and_comes_back():
    a, v = 2000.0, 1000.0
    model = feetech(32, 1, 16, overload_duty=1.0, speed_limit=v * COUNT, acceleration_limit=a * COUNT)
    command = st.signals.step(600 * COUNT, 200 * COUNT, at=0.4, unit="rad")
    r = standing(model, command, 2.0)["reference_angle"] / COUNT
    speed = np.diff(r) / 1e-3
    turn = int(np.argmax(r))
    assert r[400] == pytest.approx(0.5 * a * 0.4 * (0.4 + 1e-3), abs=1.0)
    assert r[turn] - r[399] == pytest.approx(sum(range(2, 800, 2)) * 1e-3)  # it brakes at a, beyond the new goal
    np.testing.assert_allclose(np.diff(speed[402:turn - 1]), -a * 1e-3, rtol=1e-6)
    assert r[-1] == 200.0
    assert r[turn:].min() == 200.0  # and lands without going too far again


def test_short_ticks_tend_to_the_proportional_servo_at_first_order():
    K, R, V, k_p = 345 * 3e-3, 3.0, 12.0, 6.0
    J, step = 345.0**2 * 1e-8 + 2e-3, 0.05
    plant = np.array([[0.0, 1.0], [-k_p * V * K / R / J, -K * K / R / J]])
    values, vectors = np.linalg.eig(plant)
    start = np.linalg.solve(vectors, np.array([-step, 0.0]))
    exact = step + (vectors[0] * start * np.exp(values * 0.06)).sum().real
    errors = []
    for T_c in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        model = digital({"control_period": T_c, "proportional_gain": k_p}, friction=SMOOTH)
        result = standing(model, st.signals.constant(step, unit="rad"), 0.06, load=st.loads.Inertia(2e-3))
        errors.append(abs(result["output_angle"][-1] - exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders[-1], 1.0, atol=0.15)


def test_sag_under_a_held_load_is_the_torque_over_the_stiffness_of_the_loop():
    model, torque = digital({"proportional_gain": 8.0}, friction=SMOOTH), 0.2
    load = st.loads.Constant(torque) + st.loads.Inertia(1e-3)
    result = standing(model, st.signals.constant(0.0, unit="rad"), 1.5, load=load)
    assert result["output_angle"][-1] == pytest.approx(-torque / model.loop_stiffness(), rel=1e-9)
    assert model.loop_stiffness() == pytest.approx(8.0 * 12.0 * 345 * 3e-3 / 3.0)


@pytest.mark.parametrize("speed", [0.0, 3.0, -3.0])
@pytest.mark.parametrize("duty", [0.1, 0.35, 0.8])
def test_mean_current_is_that_of_a_resolved_pwm(duty, speed):
    R, L, r_c, V_ce0, V_br, V, f = 3.0, 0.4e-3, 0.2, 0.15, 0.1, 12.0, 20e3
    K = 345 * 3e-3
    model = digital({"proportional_gain": 1e3, "duty_limit": duty}, motor={"brush_drop_voltage": V_br},
                    supply={"bridge_drop_voltage": V_ce0, "bridge_drop_resistance": r_c})
    result = st.simulate(model, st.signals.constant(1.0, unit="rad"), duration=0.0015, output_step=1e-6,
                         load=st.loads.Inertia(1e4), initial={"output_angle": 0.0, "output_speed": speed})
    i, step, total = 0.0, 1.0 / f / 2000, 0.0
    for k in range(40 * 2000):  # a free-running RL circuit, until it repeats
        on = (k % 2000) < duty * 2000
        drop = V_br + (V_ce0 + r_c * abs(i) if on else 0.0)
        i += step * ((V if on else 0.0) - K * speed - R * i - math.copysign(drop, i)) / L
        total += i if k >= 39 * 2000 else 0.0
    assert result["armature_current"][-1] == pytest.approx(total / 2000, abs=0.01 * V / R)


@pytest.mark.parametrize("off_state", ["brake", "diode", "coast"])
@pytest.mark.parametrize("torque", [0.0, -0.5, [0.0, 1.5]])
def test_energy_closes_driven_braked_and_fed_back(off_state, torque):
    model = digital(
        {"proportional_gain": 6.0, "derivative_gain": 0.05, "off_state": off_state, "duty_slew": 60.0},
        supply={"internal_resistance": 0.3, "bridge_drop_voltage": 0.2, "bridge_drop_resistance": 0.1},
        motor={"brush_drop_voltage": 0.15, "back_emf_constant": 3.1e-3})
    load = st.loads.Inertia(4e-3) + st.loads.Viscous(2e-3)
    load += st.loads.Recorded([0.0, 0.8], torque) if isinstance(torque, list) else st.loads.Constant(torque)
    result = standing(model, st.signals.step(1.0, -0.5, at=0.2, unit="rad"), 0.5, load=load)
    energy = result.energy
    assert abs(energy.residual) < 1e-9 * max(abs(energy.supply), energy.winding)
    assert energy.winding > 0.0
    assert np.all(np.isfinite(result["supply_current"]))


def test_a_brake_bridge_feeds_back_and_a_diode_does_not():
    signs = {}
    for off_state in ("brake", "diode", "coast"):
        model = digital({"proportional_gain": 4.0, "off_state": off_state}, supply={"internal_resistance": 0.2})
        result = st.simulate(model, st.signals.constant(0.5, unit="rad"), duration=0.06, load=st.loads.Inertia(0.1),
                             initial={"output_angle": 0.0, "output_speed": 11.0})
        signs[off_state] = result["supply_current"].min()
    assert signs["brake"] < -0.1
    assert min(signs["diode"], signs["coast"]) >= 0.0


def _ticking():
    """Return a servo that uses most of what a program remembers."""
    return digital({
        "compute_delay": 2.3e-3, "bus_latency": 4.2e-3, "control_phase": 3e-4, "proportional_gain": 6.0,
        "derivative_gain": 0.02, "derivative_ticks": 5.0, "integral_gain": 8.0, "integral_limit": 0.2,
        "angle_quantum": COUNT, "filter_weight": 0.7, "speed_limit": 6.0, "acceleration_limit": 80.0,
        "trip_current": 2.5, "trip_time": 0.05, "overload_duty": 0.5, "overload_time": 0.05, "stall_travel": 0.2,
        "overload_output": 0.1, "torque_off_state": "brake"}, supply={"internal_resistance": 0.3})


def test_a_run_that_is_split_pickled_and_gone_on_with_is_the_same():
    model, load = _ticking(), st.loads.Inertia(2e-3) + st.loads.Constant(0.2)
    command = st.signals.sine(mean=0.0, amplitude=0.8, frequency=2.0, unit="rad")
    sim = st.Simulator(model, load=load)
    whole = sim.advance(sim.initial(command), 0.6, command)
    state, rng = sim.initial(command), np.random.default_rng(3)
    for until in [*np.sort(rng.uniform(0.0, 0.6, 60)).tolist(), 0.3, 0.5999, 0.6]:
        if until >= state.time:
            state = pickle.loads(pickle.dumps(sim.advance(state, until, command)))
    assert state["output_angle"] == pytest.approx(whole["output_angle"], abs=1e-13)
    assert state.memory.firm[0].tick == whole.memory.firm[0].tick
    again = sim.advance(whole, 0.7, command)
    assert again == sim.advance(pickle.loads(pickle.dumps(whole)), 0.7, command)


def test_torque_off_lets_go_and_comes_back_without_a_jump():
    model = digital({"proportional_gain": 8.0, "integral_gain": 40.0, "integral_limit": 0.3})
    load, command = st.loads.Inertia(2e-3) + st.loads.Constant(0.9), st.signals.constant(0.3, unit="rad")
    sim = st.Simulator(model, load=load)
    held = sim.advance(sim.initial(command), 0.5, command)
    off = sim.advance(sim.changed(held, torque_enable=False), 0.53, command)
    assert sim.observe(off, "duty", command) == 0.0
    assert sim.observe(off, "armature_current", command) == 0.0
    assert off["output_angle"] < held["output_angle"] - 0.1
    back = sim.advance(sim.changed(off, torque_enable=True), 0.5305, command)
    assert back.memory.firm[0].J == pytest.approx(40.0 * 1e-3 * (0.3 - back.memory.firm[0].y))
    assert abs(sim.advance(back, 1.5, command)["output_angle"] - held["output_angle"]) < 0.02


def test_registers_change_while_it_runs():
    load, command = st.loads.Inertia(2e-3) + st.loads.Constant(0.2), st.signals.constant(0.0, unit="rad")
    sim = st.Simulator(digital({"proportional_gain": 4.0}, friction=SMOOTH), load=load)
    state = sim.advance(sim.initial(command), 1.0, command)
    stiff = sim.advance(sim.changed(state, parameters={"firmware.proportional_gain": 8.0}), 2.5, command)
    assert stiff["output_angle"] == pytest.approx(0.5 * state["output_angle"], rel=1e-6)
    slow = sim.changed(stiff, parameters={"firmware.control_period": 2.5e-3, "firmware.off_state": "diode"})
    assert sim.advance(slow, 3.5, command)["output_angle"] == pytest.approx(stiff["output_angle"], rel=1e-6)


def test_goals_on_their_way_arrive_whatever_is_written_next():
    model = digital({"proportional_gain": 5.0, "bus_latency": 5e-3})
    sim = st.Simulator(model)
    commands = [st.signals.constant(0.1 * k, unit="rad") for k in range(20)]
    state, seen = sim.initial(commands[0]), []
    for k in range(20):
        state = sim.advance(state, 1e-3 * (k + 1), commands[k])
        seen.append(sim.observe(state, "goal_angle", commands[k]))
    np.testing.assert_allclose(seen[6:], 0.1 * np.arange(1, 15), atol=1e-12)


@pytest.mark.long
def test_noise_is_drawn_anew_at_every_tick():
    model = digital({"proportional_gain": 1.0}, friction=LOCKED,
                    potentiometer={"feedback_gain": 0.5, "feedback_offset": 1.0, "noise": 5e-3})
    duty = standing(model, st.signals.constant(0.0, unit="rad"), 2.0, seed=4)["duty"][5:-1]
    assert np.std(duty) == pytest.approx(5e-3 / 0.5, rel=0.05)
    assert abs(np.corrcoef(duty[1:], duty[:-1])[0, 1]) < 0.08


def test_remarks_signals_and_names():
    result = standing(feetech(32, 1, 16), goal(5), 0.05)
    assert {"duty", "goal_angle", "reference_angle", "trip"} <= set(result.names)
    assert not {"error_time", "pulse_width", "feedback_voltage"} & set(result.names)
    assert result.units["duty"] == "1"
    assert result["drive"][-1] == 1.0


@pytest.mark.parametrize(("values", "command", "error", "text"), [
    ({"upper_goal": 1.0}, st.signals.constant(2.0, unit="rad"), CommandError, "the goals of test"),
    ({}, st.signals.constant(1500.0, unit="us"), CommandError, "it takes goals on a bus"),
    ({"command_kind": "pulse"}, st.signals.constant(0.5, unit="rad"), MissingParameterError,
     "electronics.one_shot_slope"),
])
def test_commands_that_it_cannot_take(values, command, error, text):
    model = digital({"proportional_gain": 5.0, **values})
    with pytest.raises(error, match=text):
        st.simulate(model, command, duration=0.1)


@pytest.mark.parametrize(("values", "text"), [
    ({"proportional_gain": 0.0}, "firmware.proportional_gain: got 0.0, allowed: a positive number"),
    ({"control_period": -1e-3}, "firmware.control_period: got -0.001"),
    ({"compute_delay": 0.1}, "firmware.compute_delay: got 0.1, allowed: at most 15 times firmware.control_period"),
    ({"lower_goal": 1.0, "upper_goal": 0.0}, "firmware.lower_goal: got 1.0"),
    ({"off_state": "float"}, "firmware.off_state: got 'float', allowed: brake or diode or coast"),
])
def test_firmware_that_cannot_be(values, text):
    with pytest.raises(ParameterError) as caught:
        digital({"proportional_gain": 5.0, **values})
    assert str(caught.value).startswith(text)


def test_a_tick_longer_than_a_frame_is_refused():
    servo = st.load_servo("hitec-hs-755hb").replace({
        "firmware.control_period": 0.03, "firmware.proportional_gain": 5.0})
    with pytest.raises(CommandError, match=r"firmware.control_period: got '30 ms', allowed: at most a frame of 20 ms"):
        st.simulate(st.DigitalServo(servo), st.signals.constant(30.0, unit="deg"), duration=0.1)


def test_an_analog_servo_has_no_torque_switch():
    sim = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    with pytest.raises(InputError, match="an analog servo has no such switch"):
        sim.changed(sim.initial(st.signals.constant(30.0, unit="deg")), torque_enable=False)

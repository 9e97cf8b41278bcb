"""Limits in which one model becomes another, and closed forms that need no engine."""

import math

import control
import numpy as np
import pytest

import servotwin as st
from servotwin import loads, physics

STEP = st.signals.step(0.7, 1.3, unit="V")


def at_end(model, command=STEP, load=None, duration=0.2):
    return st.simulate(model, command, duration=duration, load=load, output_times=[duration])[model.layout[0]][0]


def test_without_inductance_the_averaged_model_is_reached_at_first_order(servo):
    exact = at_end(st.AveragedServo(servo))
    inductances = [4e-5, 2e-5, 1e-5]
    errors = [abs(at_end(st.AveragedServoInductive(servo.replace({"motor.armature_inductance": L}))) - exact)
              for L in inductances]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.15)


def test_a_gear_of_one_is_a_motor_with_the_load_on_its_own_shaft(servo):
    load = loads.Inertia(1e-7)
    direct = st.simulate(st.DCMotor(servo), STEP, duration=0.1, load=load)
    geared = st.simulate(st.GearedMotor(servo.replace({"gear.gear_reduction": 1.0})), STEP, duration=0.1, load=load)
    np.testing.assert_allclose(geared["output_angle"], direct["motor_angle"], rtol=1e-13)


@pytest.mark.parametrize("model_class", [st.AveragedServo, st.AveragedServoInductive])
def test_without_friction_the_servo_is_linear(servo, model_class):
    free = servo.replace({"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0})
    model = model_class(free)
    result = st.simulate(model, STEP, duration=0.3, output_step=1e-3)
    system = st.linear.transfer_function(model, input="command_voltage", output="output_angle")
    response = control.step_response(system, T=result.time).outputs
    np.testing.assert_allclose(result["output_angle"] - result["output_angle"][0], 0.6 * response, atol=1e-9)


@pytest.mark.filterwarnings("ignore:.* is more than twice")
def test_the_bounded_servo_without_bounds_is_the_linear_one(servo):
    wide = servo.replace({"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
                          "electronics.voltage_deadband": 0.0, "supply.open_circuit_voltage": 1e6})
    linear = st.AveragedServo(wide)
    bounded = st.BoundedServo(wide)
    angle = st.signals.step(20.0, 80.0, at=0.0, unit="deg")
    a, b = (st.simulate(m, angle, duration=0.3)["output_angle"] for m in (linear, bounded))
    np.testing.assert_allclose(a, b, atol=1e-12)


def test_saturated_rise_in_closed_form(servo):
    model = st.BoundedServo(servo)
    result = st.simulate(model, st.signals.step(0.0, 150.0, unit="deg"), duration=0.2, output_step=0.01)
    plant = model.pack(loads.Load())
    tau = plant.shaft.J * plant.motor.R / (plant.motor.K * plant.motor.K_b)
    w_end = (plant.follower.V_max - plant.motor.R * plant.friction.F_forward / plant.motor.K) / plant.motor.K_b
    t = result.time
    np.testing.assert_allclose(result["output_angle"], w_end * (t - tau * (1.0 - np.exp(-t / tau))), atol=1e-13)


def test_a_held_servo_does_not_move_at_all_in_a_thousand_seconds(servo):
    model = st.BoundedServo(servo)
    plant = model.pack(loads.Load())
    load = loads.Constant(0.8 * plant.friction.F_backward)
    result = st.simulate(model, st.signals.constant(90.0, unit="deg"), duration=1000.0, load=load, output_step=10.0)
    assert np.all(result["output_angle"] == result["output_angle"][0])
    assert result.events == ()


def test_the_averaged_servo_creeps_under_the_same_load(servo):
    """Held by friction alone (gain next to nothing) it slips at the speed that balances tanh and damping."""
    weak = servo.replace({"electronics.bridge_gain": 1e-9})
    model = st.AveragedServo(weak)
    plant = model.pack(loads.Load())
    torque = 0.8 * plant.friction.F_backward
    result = st.simulate(model, st.signals.constant(90.0, unit="deg"), duration=20.0, load=loads.Constant(torque),
                         output_step=1.0)
    N = weak.gear.gear_reduction
    k_a, k_b = weak.motor.torque_constant, weak.motor.back_emf_constant
    damping = weak.motor.motor_viscous_friction + k_a * k_b / weak.motor.armature_resistance
    creep = physics.creep_speed(-torque, N, weak.friction.coulomb_torque_forward,
                                weak.friction.coulomb_torque_backward, weak.friction.zero_crossing_slope, damping)
    assert result["motor_speed"][-1] == pytest.approx(creep, rel=1e-6)
    assert creep < 0.0


def test_breakaway_starts_when_the_torque_exceeds_it(servo):
    model = st.BoundedServo(servo.replace({"friction.breakaway_ratio": 1.5}))
    plant = model.pack(loads.Load())
    load = loads.Recorded([0.0, 10.0], [0.0, 10.0])  # τ = t
    # without gain the torque of the load alone decides
    weak = st.BoundedServo(servo.replace({"friction.breakaway_ratio": 1.5, "electronics.bridge_gain": 1e-9}))
    result = st.simulate(weak, st.signals.constant(90.0, unit="deg"), duration=1.0, load=load)
    first = result.events[0]
    assert first.kind == "release backward"
    assert first.time == pytest.approx(1.5 * plant.friction.F_backward, rel=1e-6)


def test_bounces_on_a_stop_lose_speed_by_the_restitution(servo):
    model = st.BoundedServo(servo.replace({"stops.restitution": 0.5, "stops.upper_angle": 1.0,
                                           "electronics.bridge_gain": 1e-9}))
    command = st.signals.constant(30.0, unit="deg")
    result = st.simulate(model, command, duration=0.5, initial={"output_angle": 0.97, "output_speed": 5.0},
                         output_step=1e-3)
    hit = next(e for e in result.events if e.kind == "upper stop")
    before, after = result.trajectory.inside(0, np.array([hit.time])).speed[0], result.at("output_speed", [hit.time])[0]
    assert after == pytest.approx(-0.5 * before, rel=1e-12)
    assert result["output_angle"].max() <= 1.0
    assert result.energy.stops == pytest.approx(0.5 * model.pack(loads.Load()).shaft.J * 0.75 * before**2, rel=1e-9)


def test_it_rests_on_a_stop_and_leaves_it_when_pulled_away(servo):
    model = st.BoundedServo(servo.replace({"stops.upper_angle": 1.0}))
    push, pull = st.signals.constant(2.2, unit="V"), st.signals.constant(0.8, unit="V")
    sim = st.Simulator(model)
    state = sim.advance(sim.initial(pull), 3.0, push)
    assert state["output_angle"] == 1.0
    assert state["output_speed"] == 0.0
    assert sim.advance(state, 4.0, pull)["output_angle"] < 0.9


@pytest.mark.parametrize("slope", [0.5, 1000.0])
def test_steep_friction_neither_chatters_nor_crawls(servo, slope):
    model = st.AveragedServo(servo.replace({"friction.zero_crossing_slope": slope}))
    result = st.simulate(model, st.signals.step(0.0, 90.0, unit="deg"), duration=2.0)
    assert result.status.ok
    assert result.stats.motions < 600


def test_power_balance_at_one_instant(servo):
    """Electrical power = winding heat + mechanical power + change of magnetic energy, from the signals alone."""
    model = st.AveragedServoInductive(servo)
    result = st.simulate(model, STEP, duration=0.05, output_step=1e-5)
    i, v = result["armature_current"], result["armature_voltage"]
    di = np.gradient(i, result.time)
    R, L, k_b = (servo.motor.armature_resistance, servo.motor.armature_inductance, servo.motor.back_emf_constant)
    balance = v - R * i - k_b * result["motor_speed"] - L * di
    assert np.abs(balance[5:-5]).max() < 2e-3 * np.abs(v).max()


def test_convergence_of_the_sampled_solution_is_not_needed(servo):
    """A ramp is followed exactly whatever pieces it is cut into."""
    model = st.BoundedServo(servo)
    ramp = st.signals.ramp(0.7, 1.7, at=0.05, over=0.4, unit="V")
    t = np.linspace(0.0, 0.6, 13)
    cut = st.signals.samples(t, ramp(t), unit="V", hold="linear")
    a, b = (st.simulate(model, c, duration=0.5)["output_angle"] for c in (ramp, cut))
    np.testing.assert_allclose(a, b, atol=1e-12)
    assert math.isfinite(a[-1])

"""The digital servo's reference against what its specification states, closed forms and conservation of energy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from .digital import Trace, run
from .digital_cases import case

DELTA = 2.0 * math.pi / 4096.0
T_C = 1e-3
STS = {"control_period": T_C, "compute_delay": T_C, "angle_quantum": DELTA, "whole_counts": "yes",
       "duty_quantum": 1e-3, "filter_weight": 0.8, "duty_limit": 0.97, "command_kind": "goal"}
PLAIN = {"control_period": T_C, "command_kind": "goal", "proportional_gain": 1.0}
LOCKED = 1e3  # N m at the motor: no shaft of these turns


def servo(firmware: dict[str, Any], friction: float = LOCKED, **groups: Any) -> dict[str, dict[str, Any]]:
    values: dict[str, dict[str, Any]] = {
        "motor": {"armature_resistance": 3.0, "torque_constant": 4e-3, "back_emf_constant": 4e-3,
                  "rotor_inertia": 8e-8},
        "gear": {"gear_reduction": 250.0},
        "friction": {"coulomb_torque_forward": friction, "coulomb_torque_backward": friction},
        "supply": {"open_circuit_voltage": 12.0}, "firmware": firmware}
    return {name: values.get(name, {}) | groups.get(name, {}) for name in {**values, **groups}}


def goals(*pieces: tuple[float, ...]) -> dict[str, Any]:
    return {"kind": "goal", "pieces": [(*piece, 0.0)[:3] for piece in pieces]}


def locked(firmware: dict[str, Any], duration: float, *pieces: tuple[float, ...], **groups: Any) -> Trace:
    return run(servo(firmware, **groups), goals(*pieces), {"inertia": 1e-3}, duration, [duration])


@pytest.mark.parametrize(("P", "zone", "start", "table"), [
    (32, 1, 0, {3: 16, 4: 24, 5: 32, 6: 40, 8: 56, 9: 64}),
    (32, 1, 16, {2: 24, 3: 32, 4: 40, 5: 48, 75: 608, 85: 688, 90: 728, 95: 768, 100: 808}),
    (50, 0, 16, {1: 28, 2: 41, 3: 53}),
    (50, 1, 16, {2: 28, 3: 41, 4: 53}),
    (32, 0, 0, {1: 8, 2: 16, 3: 24, 4: 32}),
])
def test_feetech_duty_at_rest_is_the_table_to_the_integer(P: int, zone: int, start: int, table: dict[int, int]) -> None:
    firmware = STS | {
        "proportional_gain": P / (4000.0 * DELTA), "deadband_angle": zone * DELTA, "minimum_duty": start / 1000.0,
        "derivative_gain": 32 * 20 * T_C / (8000.0 * DELTA), "derivative_ticks": 20.0,
        "derivative_threshold": 2.0 * DELTA}
    for count, side in itertools.product(table, (1, -1)):
        trace = locked(firmware, 0.045, (0.0, side * count * DELTA))
        assert 1000.0 * trace.duty[-1] == pytest.approx(side * table[count], abs=1e-9)


def test_feetech_overload_trips_at_the_2000th_tick_and_ends_below_its_output() -> None:
    trace = locked(STS | {
        "proportional_gain": 32 / (4000.0 * DELTA), "deadband_angle": DELTA, "minimum_duty": 0.016,
        "overload_duty": 0.8, "overload_time": 2.0, "stall_travel": 50.0 * DELTA, "overload_output": 0.2,
    }, 2.9, (0.0, 100.0 * DELTA), (2.3, 50.0 * DELTA), (2.6, 23.0 * DELTA))
    assert 1000.0 * trace.duty[[0, 1999, 2000, 2599, 2600]] == pytest.approx([808, 808, 200, 200, 192])
    assert trace.trip[[1999, 2000, 2599, 2600]].tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(("least", "ticks"), [(50, (20, 35, 108, 400, 1056)), (0, (38, 57, 133, 429, 1099))])
@pytest.mark.parametrize("side", [1, -1])
def test_feetech_profile_takes_so_many_ticks(least: int, ticks: tuple[int, ...], side: int) -> None:
    firmware = STS | {"proportional_gain": 1e-6, "speed_limit": 1000.0 * DELTA, "acceleration_limit": 2000.0 * DELTA,
                      "minimum_speed": least * DELTA}
    for count, expected in zip((1, 2, 10, 100, 600), ticks, strict=True):
        trace = locked(firmware, (expected + 2) * T_C, (0.0, side * count * DELTA))
        there = np.abs(trace.reference - side * count * DELTA) < 1e-9 * DELTA
        assert int(np.argmax(there)) + 1 == expected


def test_a_goal_on_the_way_brakes_the_profile_before_it_turns() -> None:
    a, v = 2000.0 * DELTA, 1000.0 * DELTA
    trace = locked(STS | {"proportional_gain": 1e-6, "speed_limit": v, "acceleration_limit": a}, 2.6,
                   (0.0, 600.0 * DELTA), (0.6, 0.0))
    rate = np.diff(trace.reference) / T_C
    assert np.max(np.abs(rate)) == pytest.approx(v, rel=1e-9)
    assert np.max(np.abs(np.diff(rate))) <= a * T_C * (1.0 + 1e-6)
    assert trace.reference[650] > trace.reference[600]
    assert trace.reference[-1] == pytest.approx(0.0, abs=1e-9 * DELTA)


def test_a_rising_count_leaves_the_filtered_angle_one_low() -> None:
    values = servo(STS | {"proportional_gain": 40.0, "deadband_angle": 2.0 * DELTA}, friction=4e-4)
    trace = run(values, goals((0.0, 0.0), (0.05, 300.0 * DELTA)), {"inertia": 1e-3}, 1.0, [1.0])
    count = math.floor(trace.output_angle[-1] / DELTA + 0.5)
    assert count - round(trace.y[-1] / DELTA) == 1


# One row of the table: options, goals, expected duty by tick (None: open); the shaft is locked at angle 0.
OPTIONS: dict[str, tuple[dict[str, Any], tuple[tuple[float, ...], ...], dict[int, float | None]]] = {
    "proportional": ({}, ((0.0, 0.3),), {0: 0.3, 9: 0.3}),
    "subtracted dead zone": ({"deadband_angle": 0.1}, ((0.0, 0.3), (0.005, 0.08)), {0: 0.2, 6: 0.0}),
    "gated dead zone": ({"deadband_angle": 0.1, "deadband_law": "gate"}, ((0.0, 0.3), (0.005, 0.08)), {0: 0.3, 6: 0.0}),
    "least duty": ({"minimum_duty": 0.05}, ((0.0, 0.3), (0.005, -0.3), (0.008, 0.0)), {0: 0.35, 6: -0.35, 9: 0.0}),
    "limits": ({"torque_limit": 0.6, "duty_limit": 0.5}, ((0.0, 3.0),), {0: 0.5}),
    "quantum": ({"duty_quantum": 0.04}, ((0.0, 0.3), (0.005, -0.3)), {0: 0.28, 6: -0.28}),
    "slew": ({"duty_slew": 40.0}, ((0.0, 0.3), (0.0095, -0.3)), {0: 0.04, 1: 0.08, 8: 0.3, 10: 0.26}),
    "held derivative": ({"derivative_gain": 0.01, "derivative_ticks": 4.0}, ((0.0, 0.0), (0.0055, 0.2)),
                        {5: 0.0, 6: 0.2, 7: 0.7, 10: 0.7, 11: 0.2}),
    "derivative at power-up": ({"derivative_gain": 1e-3, "derivative_ticks": 2.0}, ((0.0, 0.2),),
                               {0: 0.2, 1: 0.3, 2: 0.3, 3: 0.2}),
    "derivative of a standing angle": ({"derivative_gain": 0.01, "derivative_of": "measurement"},
                                       ((0.0, 0.2),), {0: 0.2, 1: 0.2}),
    "integral": ({"integral_gain": 100.0}, ((0.0, 0.1),), {0: 0.11, 1: 0.12, 9: 0.2}),
    "limited integral": ({"integral_gain": 100.0, "integral_limit": 0.03}, ((0.0, 0.1),), {1: 0.12, 9: 0.13}),
    "anti-windup": ({"integral_gain": 100.0, "anti_windup": 0.5, "torque_limit": 0.15}, ((0.0, 0.2),),
                    {0: 0.15, 50: 0.15}),
    "whole counts of the integral": (
        {"integral_gain": 100.0, "whole_counts": "yes", "angle_quantum": 0.01, "duty_quantum": 0.01},
        ((0.0, 0.05),), {0: 0.05, 1: 0.06, 2: 0.06, 3: 0.07}),
    "integral at rest": ({"integral_gain": 100.0, "integral_at_rest": "yes", "rest_travel": 0.01,
                          "derivative_ticks": 3.0}, ((0.0, 0.1),), {0: 0.1, 1: 0.1, 2: 0.11, 3: 0.12}),
    "feedforward": ({"speed_limit": 1.0, "velocity_feedforward": 0.1, "acceleration_feedforward": 1e-4},
                    ((0.0, 0.01),), {0: 0.201, 1: 0.102, 9: -0.09, 10: 0.01}),
    "latency": ({"bus_latency": 2.5e-3}, ((0.0, 0.1), (0.01, 0.3)), {2: None, 3: 0.1, 12: 0.1, 13: 0.3}),
    "bounds of the goal": ({"lower_goal": -0.2, "upper_goal": 0.1}, ((0.0, 0.5), (0.005, -0.5)), {0: 0.1, 6: -0.2}),
    "rounded goal": ({"angle_quantum": 0.1}, ((0.0, 0.16),), {0: 0.2}),
    "soft start": ({"soft_start_duty": 0.1, "soft_start_time": 5e-3}, ((3e-3, 0.3),),
                   {2: None, 3: 0.1, 7: 0.1, 8: 0.3}),
    "limp without a signal": ({"signal_timeout": 5e-3, "signal_loss": "limp"}, ((0.0, 0.3), (0.01, 0.2)),
                              {4: 0.3, 5: None, 9: None, 10: 0.2, 14: 0.2, 15: None}),
    "failsafe": ({"signal_timeout": 5e-3, "signal_loss": "failsafe", "failsafe_angle": -0.1}, ((0.0, 0.3),),
                 {4: 0.3, 5: -0.1, 20: -0.1}),
    "hold": ({"signal_timeout": 5e-3}, ((0.0, 0.3),), {9: 0.3}),
    "motor current": ({"current_limit": 0.8}, ((0.0, 0.3),), {0: 0.2}),
    "bus current": ({"current_limit": 0.16, "current_sense": "bus"}, ((0.0, 0.3),), {0: 0.2}),
    "current trip": ({"trip_current": 1.0, "trip_time": 4e-3}, ((0.0, 0.3), (0.0105, 0.2)),
                     {0: 0.3, 4: 0.3, 5: None, 10: None, 11: 0.2}),  # 1.2 A, then 0.8 A
    "overload, limp": ({"overload_duty": 0.2, "overload_time": 3e-3}, ((0.0, 0.3),), {2: 0.3, 3: None, 9: None}),
    "latched overload": ({"overload_duty": 0.2, "overload_time": 3e-3, "overload_output": 0.1,
                          "overload_latches": "yes"}, ((0.0, 0.3), (0.006, -0.3)), {3: 0.1, 7: -0.1}),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_options_of_the_firmware_decide_the_duty_of_a_locked_shaft(name: str) -> None:
    firmware, pieces, expected = OPTIONS[name]
    trace = locked(PLAIN | firmware, 0.06, *pieces)
    found = {n: None if math.isnan(trace.duty[n]) else float(trace.duty[n]) for n in expected}
    assert found == {n: None if d is None else pytest.approx(d, abs=1e-12) for n, d in expected.items()}


@pytest.mark.parametrize(("state", "current"), [("open", 0.0), ("brake", 1.0 / 3.0)])
def test_torque_off_is_limp_until_it_is_on(state: str, current: float) -> None:
    """Pulled at about 1 rad/s by the load, against a brake or freely."""
    command = goals((0.0, 0.3)) | {"torque_off": [(5e-3, 20e-3)]}
    trace = run(servo(PLAIN | {"torque_off_state": state}), command, {"inertia": 1e-3}, 0.03, [4e-3, 10e-3, 25e-3])
    assert trace.duty[[4, 5, 19, 20]] == pytest.approx([0.3, math.nan, math.nan, 0.3], nan_ok=True)
    pulled = run(servo(PLAIN | {"torque_off_state": state}, friction=0.0), command | {"torque_off": [(0.0, 1.0)]},
                 {"inertia": 1e-3, "viscous_friction": 0.5, "torque": -0.5 - current}, 0.5, [0.5])
    assert pulled.current[0] == pytest.approx(-current, rel=1e-9, abs=1e-15)


def test_an_undervoltage_resets_or_stops() -> None:
    pieces, weak = ((0.0, 1.0), (0.0095, 0.1)), {"internal_resistance": 1.0}
    reset = locked(PLAIN | {"undervoltage": 10.0, "undervoltage_action": "reset", "restart_time": 4e-3}, 0.02,
                   *pieces, supply=weak)
    assert reset.trip[:11].tolist() == [0, 4, 4, 4, 4, 0, 0, 0, 0, 0, 0]
    assert np.isnan(reset.duty[1:10]).all()
    assert reset.duty[10] == pytest.approx(0.1)
    stop = locked(PLAIN | {"undervoltage": 10.0}, 0.02, *pieces, supply=weak)
    assert stop.duty[[0, 1, 2, 9, 10]] == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.1])
    assert stop.trip[:4].tolist() == [0, 4, 0, 0]


@pytest.mark.long
def test_heat_trips_until_five_kelvin_lower() -> None:
    heat = {"winding_capacity": 0.05, "housing_capacity": 0.05, "winding_to_housing": 0.05, "housing_to_ambient": 1.0}
    trace = run(servo(PLAIN | {"trip_temperature": 308.0}, thermal=heat), goals((0.0, 1.0), (0.6, -0.5)),
                {"inertia": 1e-3}, 0.7, np.arange(701) * T_C)
    tripped, warm = trace.trip == 3, trace.housing_temperature[:trace.trip.size]
    first, last = int(np.argmax(tripped)), int(np.flatnonzero(tripped)[-1])
    assert warm[first - 1] <= 308.0 < warm[first]
    assert warm[last] > 303.0 >= warm[last + 1]
    assert (trace.duty[first:600] == 0.0).all()  # goal and reference are the angle until the next goal
    assert trace.duty[601] == pytest.approx(-0.5)


def test_pulses_are_measured_in_steps_and_used_from_their_falling_edge() -> None:
    chip = {"one_shot_slope": 1.25e-3, "one_shot_offset": 0.0, "pulse_width_min": 1e-3, "pulse_width_max": 2e-3}
    pot = {"feedback_gain": 0.4, "feedback_offset": 1.2}
    values = servo({"control_period": T_C, "proportional_gain": 1.0, "pulse_resolution": 10e-6},
                   electronics=chip, potentiometer=pot)
    command = {"kind": "pulse", "edges": [0.0, 0.01, 0.02], "widths": [1.638e-3, 2.5e-3, 1.412e-3]}
    trace = run(values, command, {"inertia": 1e-3}, 0.03, [0.03])
    assert trace.duty[[1, 2, 21, 22]] == pytest.approx([math.nan, 0.26, 0.26, -0.18], nan_ok=True)


LOSSES = {"bridge_drop_voltage": 0.3, "bridge_drop_resistance": 0.2, "internal_resistance": 0.5}


@pytest.mark.parametrize(("off_state", "supply", "current", "bus"), [
    ("brake", LOSSES, (0.4 * 12.0 - 0.4 * 0.3 - 0.25) / (3.0 + 0.4 * 0.2 + 0.16 * 0.5), "0.4"),
    ("diode", LOSSES, (0.4 * 12.0 - 0.4 * 0.3 - 0.25) / (3.0 + 0.4 * 0.2 + 0.16 * 0.5), "0.4"),
    ("coast", LOSSES, (12.0 - 0.3 - 0.25) / (3.0 + 0.2 + 0.4 * 0.5), "0.4"),
    ("brake", LOSSES | {"current_limit": 0.3}, 0.3 / 0.4, "limit"),
    ("coast", LOSSES | {"current_limit": 0.3}, 0.3 / 0.4, "limit"),
])
@pytest.mark.parametrize("side", [1, -1])
def test_current_and_bus_of_a_locked_shaft(off_state: str, supply: dict[str, float], current: float, bus: str,
                                           side: int) -> None:
    trace = run(servo(PLAIN | {"off_state": off_state}, supply=supply, motor={"brush_drop_voltage": 0.25}),
                goals((0.0, 0.4 * side)), {"inertia": 1e-3}, 5e-3, [5e-3])
    slow = off_state == "coast"
    at_winding = (3.0 + (1.0 if slow else 0.4) * 0.2) * current + 0.25
    voltage = (at_winding if slow else at_winding / 0.4) + 0.3 if bus == "limit" else 12.0 - 0.5 * 0.4 * current
    assert trace.current[0] == pytest.approx(side * current, rel=1e-12)
    assert trace.bus_voltage[0] == pytest.approx(voltage, rel=1e-12)


@pytest.mark.parametrize(("friction", "most"), [
    ({}, 0.1), ({"breakaway_ratio": 1.5}, 0.15), ({"load_friction": 0.2}, 0.1 / 0.8),
    ({"load_friction_motor": 0.5, "load_friction_external": 0.2}, 0.1 / 0.8),
    ({"breakaway_ratio": 1.5, "stribeck_speed": 5.0, "load_friction": 0.2, "load_friction_stribeck": 0.1}, 0.15 / 0.7),
])
@pytest.mark.parametrize("side", [1, -1])
def test_an_unpowered_shaft_starts_where_friction_ends(friction: dict[str, float], most: float, side: int) -> None:
    values = servo(PLAIN | {"off_state": "diode"}, friction=0.1 / 250.0)
    values["friction"] |= friction
    for share, moves in ((0.9999, False), (1.0001, True)):
        load = {"inertia": 1e-3, "torque": side * share * most}
        trace = run(values, goals((1.0, 0.0)), load, 0.05, [0.05])
        assert (trace.output_angle[0] * side < 0.0) == moves
        assert (trace.output_angle[0] == 0.0) != moves


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_plant_without_friction_is_its_sampled_state_space(delay: int) -> None:
    """Braked bridge, encoder, P: x' = A x + B d, d of `delay` ticks ago, by matrix exponentials."""
    k_p, goal, ticks = 4.0, 0.2, 200
    values = servo(PLAIN | {"proportional_gain": k_p, "compute_delay": delay * T_C}, friction=0.0,
                   supply={"internal_resistance": 0.0, "bridge_drop_resistance": 0.0})
    load = {"inertia": 2e-3, "viscous_friction": 1e-2, "torque": 0.05}
    K, R, V, J = 1.0, 3.0, 12.0, 250.0**2 * 8e-8 + 2e-3
    A = np.zeros((4, 4))
    A[0, 1] = 1.0
    A[1] = [0.0, -(K * K / R + 1e-2) / J, K * V / (R * J), -0.05 / J]
    phi, state, duties = expm(A * T_C), np.array([0.0, 0.0, 0.0, 1.0]), [0.0] * delay
    trace = run(values, goals((0.0, goal)), load, ticks * T_C, np.arange(ticks + 1) * T_C)
    for n in range(ticks):
        assert trace.output_angle[n] == pytest.approx(state[0], abs=1e-12)
        assert trace.output_speed[n] == pytest.approx(state[1], abs=1e-11)
        duties.append(k_p * (goal - state[0]))
        state[2] = duties[n]
        state = phi @ state


def test_small_ticks_tend_to_the_continuous_proportional_servo_at_first_order() -> None:
    k_p, goal, end = 2.0, 0.3, 0.1
    K, R, V, J = 1.0, 3.0, 12.0, 250.0**2 * 8e-8 + 2e-3
    A = np.array([[0.0, 1.0], [-K * V * k_p / (R * J), -K * K / (R * J)]])
    exact = goal + (expm(A * end) @ np.array([-goal, 0.0]))[0]
    errors = []
    for T_c in (1e-3, 5e-4, 2.5e-4):
        values = servo(PLAIN | {"control_period": T_c, "proportional_gain": k_p}, friction=0.0)
        trace = run(values, goals((0.0, goal)), {"inertia": 2e-3}, end, [end])
        errors.append(abs(trace.output_angle[0] - exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx([1.0, 1.0], abs=0.15)


def _energy_error(trace: Trace) -> float:
    spent = sum(joule for name, joule in trace.energy.items() if name != "supply")
    return abs(trace.energy["supply"] - spent) / sum(abs(joule) for joule in trace.energy.values())


@pytest.mark.long
@pytest.mark.parametrize(("linear", "seeds"), [(True, range(16)), (False, range(7))])
def test_energy_is_kept(linear: bool, seeds: range) -> None:
    for seed in seeds:
        one = case(seed, linear=linear)
        assert _energy_error(run(*one, times=[one.duration])) < 1e-11, seed


@pytest.mark.long(but="100")
@pytest.mark.parametrize("seed", [100, 101, 102, 104, 105, 106])
def test_closed_form_and_integration_agree(seed: int) -> None:
    """A spring too soft to act sends a linear plant through the integrator."""
    one = case(seed, linear=True)
    times: NDArray[np.float64] = np.linspace(0.0, one.duration, 50)
    closed = run(*one, times=times)
    integrated = run(one.values, one.command, one.load | {"stiffness": 1e-300}, one.duration, times)
    assert np.max(np.abs(closed.output_angle - integrated.output_angle)) < 1e-11
    assert np.array_equal(closed.trip, integrated.trip)
    assert closed.duty == pytest.approx(integrated.duty, abs=1e-8, nan_ok=True)


SWINGS = [(0.02 * k, 0.2 * (-1.0) ** k) for k in range(10)]


def geared(**gear: float) -> dict[str, dict[str, Any]]:
    """A servo with load friction and drops, and a gear with what is given."""
    values = servo(PLAIN | {"proportional_gain": 6.0}, friction=3e-4, gear={"output_inertia": 1e-3, **gear},
                   supply={"bridge_drop_voltage": 0.3, "internal_resistance": 0.2})
    values["friction"] |= {"load_friction_motor": 0.2, "load_friction_external": 0.3, "bearing_coulomb_torque": 5e-3}
    return values


@pytest.mark.parametrize("torque", [0.0, 0.03, -0.3])
def test_energy_and_momentum_are_kept_across_the_play(torque: float) -> None:
    trace = run(geared(backlash=0.02), goals(*SWINGS), {"inertia": 1e-3, "torque": torque}, 0.2, [0.2])
    assert _energy_error(trace) < 1e-11
    assert trace.meetings
    J_m, J = 250.0**2 * 8e-8, 2e-3
    for meeting in trace.meetings:
        assert (J + J_m) * meeting.after == pytest.approx(J * meeting.output + J_m * meeting.motor, rel=1e-12)
        lost = 0.5 * J * J_m / (J + J_m) * (meeting.motor - meeting.output) ** 2
        assert meeting.lost == pytest.approx(lost, rel=1e-6, abs=1e-15)


@pytest.mark.long
def test_hardly_any_play_is_none() -> None:
    """Two ways of moving: from event to event in closed form, and one body whose load friction is integrated."""
    times, load = np.linspace(1e-3, 0.2, 100) + 1e-4, {"inertia": 1e-3, "torque": 0.3}
    one, two = (run(values, goals(*SWINGS), load, 0.21, times) for values in (geared(), geared(backlash=1e-12)))
    assert np.ptp(one.output_angle) > 0.05
    assert np.max(np.abs(one.output_angle - two.output_angle)) < 1e-7

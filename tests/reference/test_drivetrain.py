"""Checks of the reference with everything on: closed forms, energy, convergence, the older reference, small steps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import ellipk

from .drivetrain import ENERGIES, Trace, simulate_bus, simulate_case, source_of
from .drivetrain_cases import TERMS, Case, Command, command_of, load_of, random_case, servo_of
from .drivetrain_circuit import Source
from .drivetrain_frame import make_chip
from .drivetrain_laws import Plant, make_plant
from .drivetrain_motion import split
from .drivetrain_steps import LAWS, Rotor, budget, creep
from .pulse import solve_pulse
from .pulse_servo import Shaft

N = 200.0
VALUES: dict[str, Any] = {
    "motor.armature_resistance": 3.0, "motor.torque_constant": 1.0 / N, "motor.back_emf_constant": 1.0 / N,
    "motor.rotor_inertia": 6e-3 / N**2, "gear.gear_reduction": N, "supply.open_circuit_voltage": 6.0,
    "potentiometer.feedback_gain": 0.44, "potentiometer.feedback_offset": 0.5, "electronics.one_shot_slope": 1.3e-3,
    "electronics.stretcher_gain": 60.0, "electronics.deadband": 8e-6, "electronics.off_state": "coast",
}
HELD = Command(kind="constant", before=1.5e-3)
COARSE = {"max_step": 4e-3, "samples": 6}  # half the time where digits do not matter


def undriven(values: dict[str, Any] | None = None, **words: Any) -> Case:
    """The servo of VALUES without pulses: nothing but its mechanics, heat and what current it starts with."""
    return Case(**{"values": VALUES | (values or {}), "command": HELD, "duration": 0.1, "edges": (), **words})


def residual(run: Trace) -> float:
    """What the energy balance misses [J]."""
    e = run.energy
    return e["supply"] - sum(e[name] for name in (*ENERGIES[1:], "stops", "stored"))


def mixture(seed: int) -> Case:
    """A case with half of the terms."""
    rng = np.random.default_rng(seed)
    law = {str(rng.choice(["m3", "m4", "m5", "m6"]))}
    return random_case(seed, frozenset(x for x in sorted(TERMS - {"m3", "m4", "m5", "m6"}) if rng.random() < 0.5) | law)


# --- whole runs -------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("seed", [5, 6, 7])  # between them they have every term
def test_energy_balances_and_tolerances_do_not_matter(seed: int) -> None:
    case = replace(mixture(seed), duration=0.2)
    times = np.linspace(0.0, case.duration, 51)
    run = simulate_case(case, times)
    fine = simulate_case(case, times, rtol=1e-13, atol=1e-16, max_step=3e-4, samples=12)
    np.testing.assert_allclose(run.output_angle, fine.output_angle, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(run.motor_angle / make_plant(case.values, case.load).N,
                               fine.motor_angle / make_plant(case.values, case.load).N, rtol=0.0, atol=1e-11)
    assert abs(residual(run)) < 5e-9
    assert abs(residual(fine)) < 2e-11


@pytest.mark.long(but="4")
@pytest.mark.parametrize("seed", range(12))
def test_without_the_new_terms_it_is_the_older_reference(seed: int) -> None:
    """Taylor series there, DOP853 here; one chip."""
    kinds = [t for n, t in enumerate(("coast", "spring", "pendulum", "coulomb", "stops")) if (seed >> n % 3) & 1]
    case = random_case(500 + seed, frozenset(kinds))
    P, chip, source = make_plant(case.values, case.load), make_chip(case.values), source_of(case)
    shaft = Shaft(
        J=P.J, B=P.B_m + P.B_L, K=P.K, K_b=P.K_b, forward=P.forward, backward=P.backward, breakaway=P.r,
        coulomb=P.coulomb, R_a=P.R, R_b=source.R_b, r_c=P.r_c, V_oc=source.V_oc, V_ce0=P.V_ce0, V_br=P.V_br,
        coasts=P.coasts, stiffness=P.stiffness, rest=P.rest, gravity=P.gravity, hanging=P.hanging,
        torques=(P.torque,), lower=P.lower, upper=P.upper, restitution=P.restitution)
    times = np.linspace(0.0, case.duration, 101)
    run = simulate_case(case, times)
    older = solve_pulse(shaft, chip, case.command.width, case.duration, times, start=case.command.before,
                        y0=(case.initial.get("output_angle"), 0.0))
    np.testing.assert_allclose(run.output_angle, older.q, rtol=0.0, atol=1e-11)
    clear = ~older.near_event(times)
    np.testing.assert_allclose(run.output_speed[clear], older.w[clear], rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(run.drive[clear], older.drive[clear])
    assert run.margin == pytest.approx(older.margin, abs=1e-14)


@pytest.mark.long
def test_a_small_inductance_tends_to_none() -> None:
    case = random_case(3, frozenset({"coast", "heat", "stribeck", "m5"})).replace(
        electronics__back_emf_injection=None)
    times = np.linspace(0.0, 0.05, 6)
    short = replace(case, duration=0.05)
    plain = simulate_case(short, times).output_angle
    gap = [float(np.max(np.abs(simulate_case(short.replace(motor__armature_inductance=L), times).output_angle - plain)))
           for L in (4e-5, 2e-5)]
    assert 0.0 < gap[0] < 1e-3
    assert abs(math.log2(gap[0] / gap[1]) - 1.0) < 0.15


@pytest.mark.long
def test_bounces_between_stop_and_flank_are_all_seen() -> None:
    """Nanoseconds apart, beside pieces of milliseconds: two scans of different density find the same events."""
    case = replace(random_case(1022, TERMS - {"m3", "m4", "m6", "coast"}), duration=0.25)
    runs = [simulate_case(case, np.linspace(0.0, 0.25, 26), samples=n, max_step=h) for n, h in ((8, 2e-3), (12, 3e-4))]
    np.testing.assert_allclose(runs[0].output_angle, runs[1].output_angle, rtol=0.0, atol=1e-9)
    stops = [[t for t, k in run.events if k == "stop"] for run in runs]
    np.testing.assert_allclose(stops[0], stops[1], rtol=0.0, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("limit", [math.inf, 1.5])
def test_the_energy_of_three_servos_on_one_bus_balances(limit: float) -> None:
    terms = [frozenset({"inductance", "m5", *more}) for more in ((), ("coast", "stops"), ("backlash", "coast"))]
    cases = [replace(random_case(70 + n, t), duration=0.1) for n, t in enumerate(terms)]
    runs = simulate_bus(cases, Source(6.0, 0.3, limit), np.linspace(0.0, 0.1, 501))
    drawn = [run.drive * run.armature_current - (run.drive == 0) * coasts * np.abs(run.armature_current)
             for run, coasts in zip(runs, (False, True, True), strict=True)]
    line = np.sum(drawn, axis=0)
    free = (line < limit - 1e-9) & ((line >= 0.0) | (limit == math.inf))
    assert np.count_nonzero(free & (line > 0.1)) > 20
    np.testing.assert_allclose(runs[0].bus_voltage[free], 6.0 - 0.3 * line[free], rtol=0.0, atol=1e-12)
    assert max(abs(residual(run)) for run in runs) < 1e-9


# --- armature and supply ----------------------------------------------------------------------------------------------

LOCKED = {"friction.coulomb_torque_forward": 10.0 / N, "friction.coulomb_torque_backward": 10.0 / N,
          "motor.armature_inductance": 3e-4}


@pytest.mark.parametrize("off", ["brake", "coast"])
def test_current_decays_in_a_locked_motor(off: str) -> None:
    """i + a = (i_0 + a) e^(−Rt/L) until 0, a the voltage lost over the resistance; the battery's counts in coast."""
    case = undriven(LOCKED | {"electronics.off_state": off, "motor.brush_drop_voltage": 0.3,
                              "supply.bridge_drop_voltage": 0.4, "supply.internal_resistance": 0.5},
                    initial={"armature_current": 0.8})
    R = 3.5 if off == "coast" else 3.0
    a = (6.7 if off == "coast" else 0.3) / R
    stop = 3e-4 / R * math.log(1.0 + 0.8 / a)
    times = np.array([0.3, 0.8, 1.2]) * stop
    run = simulate_case(case, times)
    np.testing.assert_allclose(
        run.armature_current[:2], (0.8 + a) * np.exp(-R / 3e-4 * times[:2]) - a, rtol=0.0, atol=1e-12)
    assert run.armature_current[2] == 0.0
    assert [(t, k) for t, k in run.events] == [(pytest.approx(stop, abs=1e-14), "current")]
    assert run.output_angle[2] == run.output_angle[0]


@pytest.mark.parametrize("inductance", [None, 3e-4])
def test_a_regulator_gives_a_stalled_motor_what_it_may(inductance: float | None) -> None:
    case = undriven(LOCKED | {"supply.current_limit": 0.9, "supply.internal_resistance": 0.2,
                              "supply.bridge_drop_voltage": 0.4, "electronics.stretcher_gain": 1e4},
                    edges=(0.0,), initial={"output_angle": 0.2}).replace(motor__armature_inductance=inductance)
    run = simulate_case(case, [0.01])
    assert run.armature_current[0] == pytest.approx(0.9, abs=1e-9)
    assert run.bus_voltage[0] == pytest.approx(3.0 * 0.9 + 0.4, abs=1e-8)


@pytest.mark.long(but="0")
@pytest.mark.parametrize("seed", range(4))
def test_a_regulator_keeps_its_limits(seed: int) -> None:
    case = random_case(seed, frozenset({"limit", "coast"} | ({"inductance"} if seed % 2 else set())))
    run = simulate_case(case, np.linspace(0.0, case.duration, 2001))
    limit, V_oc = case.values["supply.current_limit"], case.values["supply.open_circuit_voltage"]
    drawn = run.drive * run.armature_current
    assert np.all((run.bus_voltage >= -1e-12) & (run.bus_voltage <= V_oc + 1e-12))
    assert np.all((drawn <= limit + 1e-9) | (run.bus_voltage == 0.0))
    assert np.any(np.abs(drawn - limit) < 1e-9)
    assert np.all(run.bus_voltage[drawn < -1e-9] == V_oc)


@pytest.mark.long(but="terms2")
@pytest.mark.parametrize("terms", [frozenset(), frozenset({"inductance", "coast"}), frozenset({"limit"})])
def test_twins_on_one_bus_are_one_servo_on_twice_the_resistance(terms: frozenset[str]) -> None:
    case = random_case(11, terms).replace(supply__internal_resistance=0.2)
    times, limit = np.linspace(0.0, 0.2, 41), case.values.get("supply.current_limit", math.inf)
    case = replace(case, duration=0.2)
    V_oc = case.values["supply.open_circuit_voltage"]
    pair = simulate_bus([case, case], Source(V_oc, 0.1, 2.0 * limit), times)
    one = simulate_case(case, times)
    np.testing.assert_allclose(pair[0].output_angle, one.output_angle, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(pair[1].output_angle, one.output_angle, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(pair[0].bus_voltage, one.bus_voltage, rtol=0.0, atol=1e-7)


# --- heat -------------------------------------------------------------------------------------------------------------

HEAT = {"thermal.winding_capacity": 0.02, "thermal.housing_capacity": 0.05, "thermal.winding_to_housing": 2.0,
        "thermal.housing_to_ambient": 5.0, "thermal.ambient": 300.0}


def test_two_masses_cool_by_two_exponentials() -> None:
    case = undriven(HEAT, initial={"winding_temperature": 380.0, "housing_temperature": 320.0})
    run = simulate_case(case, [0.1])
    A = np.array([[-1.0 / (0.02 * 2.0), 1.0 / (0.02 * 2.0)], [1.0 / (0.05 * 2.0), -(1.0 / 2.0 + 1.0 / 5.0) / 0.05]])
    want = 300.0 + expm(0.1 * A) @ [80.0, 20.0]
    np.testing.assert_allclose([run.winding_temperature[0], run.housing_temperature[0]], want, rtol=1e-12)


@pytest.mark.long(but="False")
@pytest.mark.parametrize("inductance", [False, True])
def test_copper_loss_is_what_heats(inductance: bool) -> None:
    terms = frozenset({"heat", "stribeck", "coast"} | ({"inductance"} if inductance else set()))
    case = random_case(8, terms).replace(thermal__housing_to_ambient=1e12, thermal__ambient=305.0)
    run, v = simulate_case(case, [case.duration], rtol=1e-13), case.values
    stored = (v["thermal.winding_capacity"] * (run.winding_temperature[0] - 305.0)
              + v["thermal.housing_capacity"] * (run.housing_temperature[0] - 305.0))
    assert stored == pytest.approx(run.energy["winding"], rel=1e-9)
    assert run.winding_temperature[0] > 315.0


def test_a_warm_motor_starts_with_less_current() -> None:
    values = LOCKED | HEAT | {"thermal.magnet_coefficient": -2e-3, "electronics.stretcher_gain": 1e4,
                              "thermal.winding_capacity": 1e9}
    case = undriven(values, edges=(0.0,), initial={"output_angle": 0.2, "winding_temperature": 398.15}).replace(
        motor__armature_inductance=None)
    assert simulate_case(case, [0.05]).armature_current[0] == pytest.approx(2.0 / 1.385, rel=1e-9)


# --- play, stops, loads -----------------------------------------------------------------------------------------------

PLAY = {"gear.backlash": 0.04, "gear.output_inertia": 2e-3}


def test_the_flank_is_hit_with_momentum_kept() -> None:
    q = 1.0
    run = simulate_case(undriven(PLAY, initial={"output_angle": q, "output_speed": 0.0, "motor_speed": 2.0 * N}),
                        [0.005, 0.05])
    hit, w = 0.02 / 2.0, 2.0 * 6.0 / 8.0
    assert run.events[0] == (pytest.approx(hit, abs=1e-14), "flank")
    np.testing.assert_allclose(run.output_angle, [q, q + w * 0.04], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(run.motor_angle / N, [q + 0.01, q + w * 0.04 + 0.02], rtol=0.0, atol=1e-13)
    assert run.energy["stops"] == pytest.approx(0.5 * 6e-3 * 4.0 - 0.5 * 8e-3 * w**2, rel=1e-12)


def test_output_glides_to_rest_inside_the_play() -> None:
    case = undriven(PLAY | {"gear.backlash": 0.4}, load={"coulomb_torque": 0.04},
                    initial={"output_angle": 1.0, "output_speed": -1.5, "motor_speed": 0.0})
    run = simulate_case(case, [0.1])
    assert run.output_angle[0] == pytest.approx(1.0 - 1.5**2 * 2e-3 / (2.0 * 0.04), abs=1e-13)
    assert run.events == ((pytest.approx(1.5 * 2e-3 / 0.04, abs=1e-13), "stick"),)
    assert run.motor_angle[0] == N


@pytest.mark.parametrize(("flank", "motor"), [(1, -0.5 * 1.2), (-1, 1.2)])
def test_only_what_pushes_towards_the_stop_rebounds(flank: int, motor: float) -> None:
    """Both move at 1.2 rad/s; a faint torque on the output decides which flank carries."""
    values = PLAY | {"stops.upper_angle": 1.005, "stops.restitution": 0.5, "stops.lower_angle": -9.0}
    start = {"output_angle": 1.0, "output_speed": 1.2, "motor_angle": N * (1.0 + flank * 0.02), "motor_speed": 1.2 * N}
    just_after = 0.005 / 1.2 + 1e-6
    case = undriven(values, initial=start, load={"torque": flank * 1e-6}, duration=just_after)
    run = simulate_case(case, [just_after])
    assert [k for _, k in run.events][-1] == "stop"
    assert run.output_speed[0] == pytest.approx(-0.6, abs=1e-5)
    assert run.motor_speed[0] / N == pytest.approx(motor, abs=1e-5)


def test_contact_ends_where_its_force_changes_sign() -> None:
    """For constant Coulomb friction, whatever the state."""
    rng = np.random.default_rng(0)
    P = make_plant(VALUES | PLAY | {"friction.coulomb_torque_forward": 0.2 / N}, {"coulomb_torque": 0.05})
    for tau_m, q, w in rng.uniform(-1.0, 1.0, (200, 3)).tolist():
        P_q = replace(P, torque=q, B_m=0.01)
        d, F = (1, 0.2) if w > 0.0 else (-1, 0.0)
        a = (tau_m - q - d * (F + 0.05) - 0.01 * w) / P.J
        force = P.J_L * a + q + d * 0.05
        apart = split(P_q, [0.0, w, 0.0, 0.0, w], d, tau_m)
        assert apart * P.J_m * P.J_L / P.J == pytest.approx(force, abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("play", [0.0, 0.04])
def test_a_pendulum_swings_with_its_period(play: float) -> None:
    """Frictionless and open; with play the hanging side swings alone as long as it does not touch."""
    values = {"gear.backlash": play, "gear.output_inertia": 2e-3} if play else {}
    size = 0.019 if play else 1.2
    load = {"pendulum.mass": 0.2, "pendulum.length": 0.1, "pendulum.hanging_angle": 1.0}
    start = {"output_angle": 1.0 + size, "motor_angle": N} if play else {"output_angle": 1.0 + size}
    P = make_plant(VALUES | values, load)
    J = P.J_L if play else P.J
    period = 4.0 * math.sqrt(J / P.gravity) * ellipk(math.sin(0.5 * size) ** 2)
    open_loop = {"motor.torque_constant": 1e-9, "motor.back_emf_constant": 1e-9}
    run = simulate_case(undriven(values | open_loop, load=load, initial=start, duration=2.0 * period),
                        [0.25 * period, period, 2.0 * period])
    np.testing.assert_allclose(run.output_angle - 1.0, [0.0, size, size], rtol=0.0, atol=1e-10)


@pytest.mark.long
def test_the_wiper_follows_through_its_play() -> None:
    case = random_case(2, frozenset({"wiper", "table", "coulomb"}))
    times = np.linspace(0.0, case.duration, 20_001)
    run, half = simulate_case(case, times), 0.5 * case.values["potentiometer.backlash"]
    wiper = run.output_angle[0]
    for q, got in zip(run.output_angle, run.wiper_angle, strict=True):
        wiper = min(max(wiper, q - half), q + half)
        assert abs(wiper - got) < 1e-6  # reversals lie between the samples
    assert np.ptp(run.output_angle) > 4.0 * half


# --- load-dependent friction ------------------------------------------------------------------------------------------


def rotor(P: Plant, v: dict[str, Any]) -> Rotor:
    F = {name.removeprefix("friction."): x for name, x in v.items() if name.startswith("friction.")}
    letters = {"K_l": "load_friction", "K_ls": "load_friction_stribeck", "K_m": "load_friction_motor",
               "K_e": "load_friction_external", "K_ms": "load_friction_motor_stribeck",
               "K_es": "load_friction_external_stribeck", "K_mq": "load_friction_motor_quad",
               "K_eq": "load_friction_external_quad"}
    return Rotor(
        N=P.N, J=P.J, k_a=P.K / P.N, k_b=P.K_b / P.N, R_a=P.R, L_a=P.L, B_m=P.B_m / P.N**2, B_L=P.B_L,
        F_forward=F["coulomb_torque_forward"], F_backward=F["coulomb_torque_backward"],
        r=F.get("breakaway_ratio", 1.0), v_s=F["stribeck_speed"], alpha=F.get("stribeck_exponent", 1.0),
        **{letter: F.get(name, 0.0) for letter, name in letters.items()}, coulomb=P.coulomb, torque=P.external)


def law_case(law: str, seed: int, more: frozenset[str] = frozenset()) -> Case:
    terms = {"M1": set(), "M2": {"stribeck"}}.get(law, {law.lower(), "stribeck"})
    case = random_case(seed, frozenset(terms) | more)
    speed = case.values.get("friction.stribeck_speed", 100.0)  # what M1 and M3 do not read
    plain = {"friction__breakaway_ratio": 1.0} if law in ("M1", "M3") else {}
    return case.replace(friction__stribeck_speed=speed, **plain)


@pytest.mark.parametrize("law", LAWS)
def test_one_formula_says_what_six_say(law: str) -> None:
    case = law_case(law, 5)
    P = make_plant(case.values, case.load)
    R = rotor(P, case.values)
    for tau_m, tau_e, w in np.random.default_rng(1).uniform(-1.0, 1.0, (300, 3)).tolist():
        for direction in (1, -1):
            got = P.budget(direction, tau_m, tau_e, P.stribeck(abs(w)), P.signs(tau_m, tau_e))
            assert got + P.B_m * abs(w) == pytest.approx(budget(R, law, direction, w, tau_m, tau_e), rel=1e-13)


@pytest.mark.long(but="True-24-M6")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("inductance", "seed"), [(False, 21), (True, 24)])
def test_small_steps_come_to_the_same_angle(law: str, inductance: bool, seed: int) -> None:
    """A braked bridge without drops: the armature voltage is the drive times the supply's."""
    more = frozenset({"inductance", "pendulum"}) if inductance else frozenset({"pendulum"})
    case = replace(law_case(law, seed, more).replace(
        supply__bridge_drop_voltage=None, motor__brush_drop_voltage=None, supply__bridge_drop_resistance=None,
        supply__internal_resistance=None), duration=0.06)
    P, V = make_plant(case.values, case.load), case.values["supply.open_circuit_voltage"]
    switches = sorted({0.0, *(t for t, k in simulate_case(case, []).events if k in ("decision", "drive_end")), 0.06})
    run = simulate_case(case, switches)
    profile = [(t, V * d) for t, d in zip(switches[:-1], run.drive[:-1], strict=True)]
    q, _ = creep(rotor(P, case.values), law, profile, 0.06, 1e-5, start=run.output_angle[0])
    assert np.ptp(run.output_angle) > 0.005
    np.testing.assert_allclose(q, run.output_angle[1:], rtol=0.0, atol=4e-5)


# --- cases ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_cases_are_repeatable_and_the_package_takes_them(seed: int) -> None:
    a, b = mixture(seed), mixture(seed)
    assert a == b
    servo, load, command = servo_of(a), load_of(a), command_of(a)
    P = make_plant(a.values, a.load)
    assert {name: servo.get(name) for name in servo.names()} == a.values
    assert load.total_inertia + (servo.gear.output_inertia or 0.0) == pytest.approx(P.J_L, rel=1e-14)
    assert float(load.external_torque(0.0, 1.3)) == pytest.approx(P.external(1.3), rel=1e-13, abs=1e-16)
    assert command.initial == a.command.before
    for t in np.linspace(0.0, a.duration, 7):
        assert float(command(t)) == pytest.approx(a.command.width(t), rel=1e-14)


@pytest.mark.slow
def test_terms_show() -> None:
    """Stops are hit, limits bind, flanks are changed and windings heat in most of the cases that have them."""
    wanted = {"stops": "stop", "limit": "supply", "backlash": "flank"}
    for term, event in wanted.items():
        runs = [simulate_case(random_case(seed, frozenset({term})), [], **COARSE) for seed in range(10)]
        assert sum(event in {k for _, k in run.events} for run in runs) >= 6, term
    rises = []
    for case in (random_case(seed, frozenset({"heat"})) for seed in range(10)):
        temperature = simulate_case(case, np.linspace(0.0, case.duration, 21), **COARSE).winding_temperature
        rises.append(float(np.max(temperature) - temperature[0]))
    assert 10.0 < float(np.median(rises)) < 90.0

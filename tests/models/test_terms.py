"""Which model reads which effect, which states that makes, and the laws of friction and potentiometer inside them."""

import math

import numpy as np
import pytest

import servotwin as st
from conftest import EVERYTHING
from reference.drivetrain_steps import LAWS, Rotor, budget
from servotwin.models import MODELS
from servotwin.models.terms.friction import holding_friction, sliding_friction
from servotwin.models.terms.numbers import at_temperature

HEAT = {name: value for name, value in EVERYTHING.items() if name.startswith("thermal.")}
PLAY = {"gear.backlash": 0.02, "gear.output_inertia": 1e-3}
SINE = st.signals.sine(mean=45.0, amplitude=20.0, frequency=3.0, unit="deg")


# --- what is read -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["pulse", "pulse-inductive"])
def test_pulse_servos_read_every_effect(servo, name):
    ignored = set(MODELS[name](servo.replace(EVERYTHING | {"motor.armature_inductance": 3e-4})).ignored)
    assert not ignored & set(EVERYTHING)
    assert ("motor.armature_inductance" in ignored) == (name == "pulse")


@pytest.mark.parametrize("name", ["averaged", "averaged-inductive", "bounded"])
def test_models_with_a_mean_voltage_read_none(servo, name):
    own = {"friction.breakaway_ratio", "gear.output_inertia"}
    worn, plain = MODELS[name](servo.replace(EVERYTHING)), MODELS[name](servo)
    assert set(EVERYTHING) - own <= set(worn.ignored)
    command, times = st.signals.step(20.0, 60.0, unit="deg"), np.linspace(0.0, 0.3, 31)
    same = MODELS[name](servo.replace({key: EVERYTHING[key] for key in own}))
    runs = [st.simulate(model, command, duration=0.3, output_times=times)["output_angle"] for model in (worn, same)]
    assert np.array_equal(*runs)
    assert plain.states == worn.states


@pytest.mark.parametrize(("changes", "name", "more"), [
    ({}, "pulse", ()), ({}, "pulse-inductive", ("armature_current",)),
    (HEAT, "pulse", ("winding_temperature", "housing_temperature")), (PLAY, "pulse", ("motor_angle", "motor_speed")),
    (HEAT | PLAY, "pulse-inductive", ("armature_current", "winding_temperature", "housing_temperature", "motor_angle",
                                      "motor_speed"))])
def test_states_and_signals_are_those_of_the_effects(servo, changes, name, more):
    model = MODELS[name](servo.replace({"motor.armature_inductance": 3e-4} | changes))
    assert tuple(place.name for place in model.states) == ("output_angle", "output_speed", *more)
    assert ("winding_temperature" in model.available) == (changes.keys() >= HEAT.keys())
    assert {"motor_angle", "motor_speed", "armature_current"} <= set(model.available)  # computed where no state


@pytest.mark.parametrize("name", [
    "gear.backlash", "potentiometer.backlash", "friction.load_friction_motor", "friction.stribeck_speed",
    "supply.current_limit", "potentiometer.quantisation", "potentiometer.linearity_error"])
def test_no_effect_is_without_effect(servo, name):
    """Each moves the shaft on its own, beyond what rounding does."""
    need = {"gear.backlash": PLAY, "friction.stribeck_speed": {"friction.breakaway_ratio": 1.3},
            "potentiometer.linearity_error": {"potentiometer.linearity_angle": [0.0, 1.0, 2.0]}}.get(name, {})
    both = {name: EVERYTHING[name]} | need
    base = {key: value for key, value in both.items() if key not in (name, "potentiometer.linearity_angle")}
    # A limit that binds.
    both = both | ({"supply.current_limit": 0.4} if name == "supply.current_limit" else {})
    runs = [st.simulate(st.PulseServo(servo.replace(changes)), SINE, duration=0.4)["output_angle"]
            for changes in (base, both)]
    assert np.max(np.abs(runs[0] - runs[1])) > 1e-5


# --- friction ---------------------------------------------------------------------------------------------------------

LETTERS = {"M3": ("K_l",), "M4": ("K_l", "K_ls"), "M5": ("K_m", "K_e", "K_ms", "K_es"),
           "M6": ("K_m", "K_e", "K_ms", "K_es", "K_mq", "K_eq")}
NAMES = {"K_l": "load_friction", "K_ls": "load_friction_stribeck", "K_m": "load_friction_motor",
         "K_e": "load_friction_external", "K_ms": "load_friction_motor_stribeck",
         "K_es": "load_friction_external_stribeck", "K_mq": "load_friction_motor_quad",
         "K_eq": "load_friction_external_quad"}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("exponent", [None, 1.0, 2.0, 0.7])
def test_one_budget_says_what_six_formulas_say(servo, law, exponent):
    numbers = np.random.default_rng(3)
    N, forward, backward, v_s, r = 250.0, 4e-4, 6e-4, 300.0, 1.0 if law in ("M1", "M3") else 1.35
    shares = dict(zip(LETTERS.get(law, ()), numbers.uniform(0.05, 0.4, 6).tolist(), strict=False))
    plant = st.PulseServo(servo.replace({
        "gear.gear_reduction": N, "friction.coulomb_torque_forward": forward,
        "friction.coulomb_torque_backward": backward, "friction.breakaway_ratio": r, "friction.stribeck_speed": v_s,
        "friction.stribeck_exponent": exponent} | {f"friction.{NAMES[K]}": share for K, share in shares.items()},
    )).pack(st.loads.Load())
    R = Rotor(N=N, J=1.0, k_a=1.0, k_b=1.0, R_a=1.0, F_forward=forward, F_backward=backward, r=r, v_s=v_s,
              alpha=exponent or 1.0, **shares)
    for tau_m, tau_e, w in numbers.uniform(-1.0, 1.0, (200, 3)).tolist():
        for direction in (1, -1):
            got = sliding_friction(plant.friction, direction > 0, direction * abs(w), tau_m, tau_e)
            assert got == pytest.approx(budget(R, law, direction, w, tau_m, tau_e), rel=1e-13)
            held = holding_friction(plant.friction, direction > 0, tau_m, tau_e)
            assert held == pytest.approx(budget(R, law, direction, 0.0, tau_m, tau_e), rel=1e-13)


def test_without_a_speed_the_static_part_ends_with_rest(servo):
    changes = {"friction.breakaway_ratio": 1.5, "friction.load_friction_motor_stribeck": 0.2}
    plant = st.PulseServo(servo.replace(changes)).pack(st.loads.Load())
    F = plant.friction.F_forward
    assert sliding_friction(plant.friction, True, 1e-9, 0.3, 0.0) == F
    assert holding_friction(plant.friction, True, 0.3, 0.0) == pytest.approx(1.5 * F + 0.2 * 0.3)


# --- heat -------------------------------------------------------------------------------------------------------------


def test_a_plant_at_its_reference_is_the_plant_itself(servo):
    plant = st.PulseServoInductive(servo.replace(EVERYTHING)).pack(st.loads.Load())
    assert at_temperature(plant, 298.15, 298.15) == plant
    warm = at_temperature(plant, 398.15, 348.15)
    assert warm.motor.R == pytest.approx(1.385 * plant.motor.R, rel=1e-14)
    assert warm.bridge.R_drive - warm.motor.R == pytest.approx(plant.bridge.R_drive - plant.motor.R, rel=1e-13)
    assert (warm.motor.K, warm.motor.K_b) == pytest.approx((0.95 * plant.motor.K, 0.95 * plant.motor.K_b), rel=1e-14)


# --- potentiometer ----------------------------------------------------------------------------------------------------


def worn(servo, *names):
    return st.PulseServo(servo.replace({name: value for name, value in EVERYTHING.items()
                                        if name.startswith("potentiometer.") and name.partition(".")[2] in names}))


def test_feedback_is_a_count_of_a_table_behind_a_play(servo):
    """v_o = Quant(p q_w + b_o + ε(q_w)), step by step."""
    model = worn(servo, "backlash", "linearity_angle", "linearity_error", "quantisation")
    times = np.linspace(0.0, 0.7, 7001)
    result = st.simulate(model, SINE, duration=0.7, output_times=times)
    p, b_o = servo.potentiometer.feedback_gain, servo.potentiometer.feedback_offset
    half, step = 0.5 * EVERYTHING["potentiometer.backlash"], EVERYTHING["potentiometer.quantisation"]
    wiper = result["output_angle"][0]
    for q, got, v_o in zip(result["output_angle"], result.trajectory.at(times).wiper, result["feedback_voltage"],
                           strict=True):
        wiper = min(max(wiper, q - half), q + half)
        assert got == pytest.approx(wiper, abs=1e-5)  # a turn lies between two samples
        exact = p * got + b_o + float(np.interp(got, [0.0, 1.0, 2.0], [0.0, 0.01, -0.01]))
        assert v_o == pytest.approx(step * math.floor(exact / step + 0.5), abs=1e-12) or \
            abs(exact / step % 1.0 - 0.5) < 1e-9
    assert np.ptp(result["output_angle"]) > 10.0 * half


def test_the_start_is_where_the_table_has_the_wanted_voltage(servo):
    """p q + b_o + ε(q) is the command's voltage, steps left out."""
    model = worn(servo, "linearity_angle", "linearity_error", "quantisation")
    p, b_o = servo.potentiometer.feedback_gain, servo.potentiometer.feedback_offset
    for degrees in (5.0, 40.0, 80.0, 130.0):
        q = st.Simulator(model).initial(st.signals.constant(degrees, unit="deg"))["output_angle"]
        error = float(np.interp(q, [0.0, 1.0, 2.0], [0.0, 0.01, -0.01]))
        assert p * q + b_o + error == pytest.approx(p * math.radians(degrees) + b_o, abs=1e-12)

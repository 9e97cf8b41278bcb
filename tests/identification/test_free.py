"""The searched numbers: lumps, scales, bounds, priors, starts, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH
from servotwin.errors import InputError, ServotwinError
from servotwin.identification.fitting.search.free import LUMPED, Space, nominal, unit_of_free

MODEL = st.PulseServo(TRUTH)
N = TRUTH.gear.gear_reduction
BOTH = ["motor.armature_resistance", "friction.coulomb_torque_forward"]  # one by its logarithm, one plainly


def space(free, servo=TRUTH, model=st.PulseServo, **more):
    return Space(model(servo), free, **more)


# ------------------------------------------------------------------------------------------ lumps

@pytest.mark.parametrize(("name", "member", "power"), [
    ("output_torque_constant", "motor.torque_constant", 1), ("output_inertia", "motor.rotor_inertia", 2),
    ("output_coulomb_torque", "friction.coulomb_torque_backward", 1)])
def test_a_lump_is_its_member_seen_at_the_output(name, member, power):
    """Torques go with N and inertias with N², by the power balance of a gear."""
    assert nominal(TRUTH, name) == pytest.approx(TRUTH.get(member) * N**power, rel=1e-14)
    s = space([name])
    columns = s.columns(s.start[None, :])
    assert set(columns) == set(LUMPED[name][0])
    for column in columns.values():
        assert column[0] == pytest.approx(TRUTH.get(member), rel=1e-14)


def test_lumps_keep_their_meaning_while_the_reduction_is_searched_too():
    s = space(["gear.gear_reduction", *LUMPED])
    x = s.start.copy()
    x[0] *= 1.5
    columns = {name: float(c[0]) for name, c in s.columns(x[None, :]).items()}
    assert columns["gear.gear_reduction"] == pytest.approx(1.5 * N)
    for name, (members, power, _) in LUMPED.items():
        for member in members:
            assert columns[member] * columns["gear.gear_reduction"] ** power == pytest.approx(nominal(TRUTH, name))


def test_unequal_motor_constants_become_one():
    servo = TRUTH.replace({"motor.back_emf_constant": 1.2 * TRUTH.motor.torque_constant})
    assert nominal(servo, "output_torque_constant") == pytest.approx(1.1 * N * TRUTH.motor.torque_constant)


def test_the_servo_of_a_point_has_its_values():
    s = space(["motor.armature_resistance", "output_inertia"])
    servo = s.servo_at(s.start + np.log([2.0, 3.0]))
    assert servo.motor.armature_resistance == pytest.approx(2.0 * TRUTH.motor.armature_resistance)
    assert servo.motor.rotor_inertia == pytest.approx(3.0 * TRUTH.motor.rotor_inertia)


@pytest.mark.parametrize(("name", "unit"), [("output_torque_constant", "N m/A"), ("load.pendulum.mass", "kg"),
                                            ("electronics.deadband", "s"), ("load.inertia", "kg m2")])
def test_units(name, unit):
    assert unit_of_free(name) == unit


# ----------------------------------------------------------------------------------------- scales

@pytest.mark.parametrize("name", ["motor.armature_resistance", "friction.coulomb_torque_forward",
                                  "electronics.one_shot_offset", "gear.gear_reduction"])
def test_value_and_scaled_are_inverse_and_slope_is_their_derivative(name):
    p = space([name]).parameters[0]
    for factor in (0.5, 1.0, 1.7):
        value = p.start * factor
        assert p.value(p.scaled(value)) == pytest.approx(value, rel=1e-13)
        x, h = p.scaled(value), 1e-6
        assert p.slope(x) == pytest.approx((p.value(x + h) - p.value(x - h)) / (2.0 * h), rel=1e-8)


def test_shares_are_relative_changes():
    s = space(BOTH)
    assert s.shares(s.start) == pytest.approx([1.0, 1.0])
    assert s.shares(s.start * [1.0, 2.0]) == pytest.approx([1.0, 0.5])
    assert np.isnan(s.shares(s.start * [1.0, 0.0])[1])


def _numbers():
    tables = ("electronics.off_state", "electronics.silence_state", "potentiometer.linearity_angle",
              "potentiometer.linearity_error")
    return [name for name in (*MODEL.requires, *MODEL.optional) if name not in tables]


@pytest.mark.parametrize("name", _numbers())
def test_every_number_that_the_model_reads_can_be_searched(name):
    p = space([name]).parameters[0]
    assert p.lower < p.upper
    assert p.lower <= p.start <= p.upper
    assert p.scale != 0.0
    assert np.isfinite([p.scaled(p.start), p.value(p.scaled(p.start))]).all()


@pytest.mark.parametrize(("name", "most"), [("motor.motor_viscous_friction", 1.0), ("gear.output_inertia", 0.1),
                                            ("load.inertia", 0.1), ("load.viscous_friction", 1.0)])
def test_what_starts_at_zero_has_a_scale_of_its_size(name, most):
    """At the output shaft, one step of the search is no more than matters there: K²/R is 0.36 N m s/rad here."""
    p = space([name]).parameters[0]
    at_output = N**2 if name.startswith("motor.") else 1.0
    assert p.start == 0.0
    assert 1e-4 < p.scale * at_output < most


# ----------------------------------------------------------------------------------------- bounds

def test_bounds_are_those_given_and_the_start_lies_within():
    s = space(BOTH, bounds={BOTH[0]: (5.0, 6.0), BOTH[1]: (0.0, 1e-4)})
    assert [(p.lower, p.upper, p.bounded) for p in s.parameters] == [(5.0, 6.0, True), (0.0, 1e-4, True)]
    assert s.values(s.lower) == pytest.approx([5.0, 0.0])
    assert s.values(s.upper) == pytest.approx([6.0, 1e-4])
    assert s.values(s.start) == pytest.approx([5.0, 1e-4])


def test_usual_bounds_are_those_of_the_physics_and_wide():
    s = space(["friction.breakaway_ratio", "stops.restitution", "gear.gear_reduction", "motor.armature_resistance",
               "electronics.one_shot_offset"])
    bounds = {p.name: (p.lower, p.upper) for p in s.parameters}
    assert bounds["friction.breakaway_ratio"][0] == 1.0
    assert bounds["stops.restitution"] == (0.0, 1.0)
    assert bounds["gear.gear_reduction"][0] == 1.0
    assert bounds["motor.armature_resistance"] == pytest.approx((3.04101 / 20.0, 3.04101 * 20.0))
    assert bounds["electronics.one_shot_offset"][0] < 0.0 < bounds["electronics.one_shot_offset"][1]


@pytest.mark.parametrize("bounds", [{BOTH[0]: (2.0, 4.0), BOTH[1]: (0.0, 1e-3)}, None])
def test_random_starts_lie_within_bounds_and_fill_those_given(bounds):
    s = space([*BOTH, "friction.breakaway_ratio", "electronics.deadband"], bounds=bounds)
    rng = np.random.default_rng(0)
    x = np.array([s.random(rng) for _ in range(2000)])
    assert (x >= s.lower - 1e-12).all()
    assert (x <= s.upper + 1e-12).all()
    assert (np.ptp(x[:, :2], axis=0) > 0.0).all()
    if bounds:
        filled = np.quantile((x[:, :2] - s.lower[:2]) / (s.upper - s.lower)[:2], [0.05, 0.5, 0.95], axis=0)
        assert filled == pytest.approx(np.array([[0.05] * 2, [0.5] * 2, [0.95] * 2]), abs=0.03)
    again = np.random.default_rng(0)
    assert (s.random(again) == x[0]).all()


# ----------------------------------------------------------------------------------------- priors

def test_priors_are_those_given_on_the_scale_of_the_search():
    s = space(BOTH, priors={BOTH[0]: (3.3, 0.2), BOTH[1]: (1e-3, 1e-4)})
    assert s.parameters[0].scaled_prior == pytest.approx((np.log(3.3 / s.parameters[0].scale), 0.2 / 3.3))
    assert s.parameters[1].scaled_prior == pytest.approx((1e-3 / s.parameters[1].scale, 1e-4 / s.parameters[1].scale))
    assert all(p.prior is None for p in space(BOTH, priors=None).parameters)


def test_priors_of_the_servo_are_the_spread_that_its_file_states():
    """A range is uniform: by its mean square distance from the value, of logarithms where these are searched."""
    s = space(["motor.armature_resistance", "potentiometer.feedback_gain", "output_torque_constant", "output_inertia"],
              priors="servo")
    resistance, gain, constant, inertia = (p.prior for p in s.parameters)
    def away(value, lower, upper):
        x = np.linspace(np.log(lower / value), np.log(upper / value), 200001)
        return value * np.sqrt(np.mean(x**2))

    assert resistance == pytest.approx((3.04101, away(3.04101, 2.75373, 3.72429)), rel=1e-4)
    assert gain == pytest.approx((0.41966, 0.00225858))
    assert constant == pytest.approx((N * 3.71284e-3, N * away(3.71284, 3.65251, 4.0119) * 1e-3), rel=1e-4)
    assert inertia == pytest.approx((N**2 * 7.65306e-8, N**2 * away(0.765306, 0.127551, 2.55102) * 1e-7), rel=1e-4)


def test_a_range_about_its_middle_is_its_width_over_the_root_of_twelve():
    made = TRUTH.replace({"potentiometer.feedback_offset": 0.2})
    quantity = replace(made.source("potentiometer.feedback_offset"), lower=0.14, upper=0.26)
    made = replace(made, quantities={**made.quantities, "potentiometer.feedback_offset": quantity})
    (p,) = space(["potentiometer.feedback_offset"], servo=made, priors="servo").parameters
    assert p.prior == pytest.approx((0.2, 0.12 / np.sqrt(12.0)))
    assert p.of_file
    (p,) = space(["potentiometer.feedback_offset"], servo=made, priors={p.name: (0.2, 0.01)}).parameters
    assert not p.of_file


def test_a_servo_without_spread_gives_no_priors():
    bare = st.servo_from_values("bare", {"motor": {"armature_resistance": 3.0}})
    values = {name: TRUTH.get(name) for name in MODEL.requires}
    made = bare.replace({k: v for k, v in values.items() if v is not None})
    assert all(p.prior is None for p in space(BOTH, servo=made, priors="servo").parameters)


# -------------------------------------------------------------------------------- what is refused

@pytest.mark.parametrize(("free", "words"), [
    ([], "at least one name"), ("output_inertia", "a list"), (3, "a list"),
    (["motor.armature_resistence"], "did you mean 'motor.armature_resistance'"),
    (["electronics.bridge_gain"], "PulseServo does not read 'electronics.bridge_gain'"),
    (["output_inertia", "output_inertia"], "twice"),
    (["output_inertia", "motor.rotor_inertia"], "both set motor.rotor_inertia"),
    (["friction.coulomb_torque_forward", "output_coulomb_torque"], "both set friction.coulomb_torque_forward"),
    (["electronics.off_state"], "a number"), (["potentiometer.linearity_error"], "a number"), ([3], "unknown"),
], ids=["none", "text", "number", "typing error", "not read", "twice", "lump and member", "member and lump", "word",
        "table", "no text"])
def test_names_that_cannot_be_searched_are_refused_in_one_line(free, words):
    with pytest.raises(ServotwinError, match=words) as caught:
        space(free)
    assert "\n" not in str(caught.value)


BAD_BOUNDS = [(2.0, 1.0), (1.0, 1.0), (float("nan"), 1.0), (1.0, float("inf")), (-1.0, 1.0), (0.0, 1.0), (1.0,),
              (1.0, 2.0, 3.0), "ab", 3.0]


@pytest.mark.parametrize("bounds", BAD_BOUNDS, ids=[f"{k}" for k in range(len(BAD_BOUNDS))])
def test_bounds_that_make_no_sense_are_refused(bounds):
    with pytest.raises(InputError, match=r"bounds of motor\.armature_resistance") as caught:
        space(BOTH, bounds={BOTH[0]: bounds})
    assert "\n" not in str(caught.value)


BAD_PRIORS = [(1.0, 0.0), (1.0, -1.0), (1.0, float("nan")), (float("nan"), 1.0), (-1.0, 1.0), (0.0, 1.0), (1.0,), 3.0,
              None, "ab"]


@pytest.mark.parametrize("prior", BAD_PRIORS, ids=[f"{k}" for k in range(len(BAD_PRIORS))])
def test_priors_that_make_no_sense_are_refused(prior):
    """A positive quantity cannot be believed to be 0 or less."""
    with pytest.raises(InputError, match=r"prior of motor\.armature_resistance"):
        space(BOTH, priors={BOTH[0]: prior})


@pytest.mark.parametrize(("more", "words"), [
    ({"bounds": {"motor.rotor_inertia": (1e-9, 1e-6)}}, "not free"),
    ({"priors": {"motor.rotor_inertia": (1e-8, 1e-9)}}, "not free"),
    ({"bounds": [1.0, 2.0]}, "bounds"), ({"priors": [1.0]}, "priors"), ({"priors": "sevro"}, '"servo"'),
    ({"bounds": {BOTH[1]: (-1e-3, 1e-3)}}, "bounds"),
    ({"bounds": {BOTH[0]: (30.0, 31.0)}, "priors": {BOTH[0]: (0.0, 1.0)}}, "prior"),
], ids=["bounds of another", "prior of another", "bounds a list", "priors a list", "priors misspelt",
        "negative friction", "both"])
def test_other_bad_input_is_refused(more, words):
    with pytest.raises(InputError, match=words):
        space(BOTH, **more)


def test_bounds_below_the_least_reduction_are_refused():
    with pytest.raises(InputError, match=r"gear\.gear_reduction"):
        space(["gear.gear_reduction"], bounds={"gear.gear_reduction": (0.1, 0.5)})


# ------------------------------------------------------------------------------------------ of another model

def test_a_changed_space_keeps_bounds_priors_and_load():
    bounds, priors = {BOTH[0]: (1.0, 9.0)}, {BOTH[0]: (3.0, 0.3), BOTH[1]: (0.1, 0.02)}
    old = space([*BOTH, "load.inertia"], bounds=bounds, priors=priors, load={"load.inertia": 2e-3})
    new = old.changed(MODEL, [*BOTH, "load.inertia", "motor.rotor_inertia"])
    for name in (*BOTH, "load.inertia"):
        assert new.parameters[new.names.index(name)] == old.parameters[old.names.index(name)]
    assert new.parameters[-1].prior is None
    fewer = old.changed(MODEL, [*BOTH, "load.inertia"], believed=[BOTH[1]])
    assert [p.prior for p in fewer.parameters] == [None, priors[BOTH[1]], None]
    assert (fewer.parameters[0].lower, fewer.parameters[0].upper) == bounds[BOTH[0]]
    moved = old.changed(MODEL, ["load.inertia"], at=np.array([p.scaled(2.0 * p.start) for p in old.parameters]))
    assert moved.parameters[0].start == pytest.approx(4e-3, rel=1e-12)

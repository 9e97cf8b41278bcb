"""Loads add up: the sum acts on the shaft as its parts do together, in any order."""

import functools
import math
import operator
import pickle

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import servotwin
from servotwin import loads
from servotwin.errors import InputError, LoadError
from servotwin.loads import Constant, Coulomb, Flexible, Free, Inertia, Load, Pendulum, Recorded, Spring, Viscous
from servotwin.logs.sidecar import load_from_words, words_of_load

sizes = st.one_of(st.just(0.0), st.floats(1e-6, 10.0))
angles = st.floats(-7.0, 7.0)
RECORD = Recorded([0.0, 1.0, 3.0], [0.0, 1.0, -1.0])

parts = st.one_of(
    st.builds(Free), st.builds(Inertia, sizes), st.builds(Viscous, sizes), st.builds(Constant, angles),
    st.builds(Coulomb, sizes), st.builds(Spring, sizes, angles),
    st.builds(Pendulum, mass=sizes, length=sizes, hanging_angle=angles, inertia=st.none() | sizes),
    st.builds(lambda dt, y: Recorded(np.cumsum([-1.0, *dt]), y[:len(dt) + 1]),
              st.lists(st.floats(2.0, 4.0), min_size=1, max_size=4), st.lists(angles, min_size=5, max_size=5)),
)
several = st.lists(parts, min_size=1, max_size=6)
TIME = np.linspace(0.0, 1.0, 11)
ANGLE = np.linspace(-4.0, 9.0, 11)


def added(items):
    return functools.reduce(operator.add, items, Load())


def same(a, b):
    assert a.inertia == pytest.approx(b.inertia, rel=1e-14)
    assert a.total_inertia == pytest.approx(b.total_inertia, rel=1e-14)
    assert a.viscous_friction == pytest.approx(b.viscous_friction, rel=1e-14)
    assert a.coulomb_torque == pytest.approx(b.coulomb_torque, rel=1e-14)
    assert a.time_span == b.time_span
    np.testing.assert_allclose(a.external_torque(TIME, ANGLE), b.external_torque(TIME, ANGLE), rtol=1e-12, atol=1e-10)


# ---------------------------------------------------------------------------------------- sums

@given(parts, parts)
def test_two_parts_commute_exactly(a, b):
    assert a + b == b + a
    assert hash(a + b) == hash(b + a)


@given(parts, parts, parts)
def test_sums_are_associative_up_to_rounding(a, b, c):
    same((a + b) + c, a + (b + c))


@given(several, st.randoms())
def test_the_order_does_not_matter(items, random):
    shuffled = list(items)
    random.shuffle(shuffled)
    same(added(items), added(shuffled))


@given(several)
def test_a_sum_acts_as_its_parts_together(items):
    load, single = added(items), [loads.as_load(item) for item in items]
    for name in ("total_inertia", "viscous_friction", "coulomb_torque"):
        assert getattr(load, name) == pytest.approx(sum(getattr(one, name) for one in single), rel=1e-13)
    torque = sum(one.external_torque(TIME, ANGLE) for one in single)
    np.testing.assert_allclose(load.external_torque(TIME, ANGLE), torque, rtol=1e-12, atol=1e-9)


@given(parts)
def test_nothing_adds_nothing(part):
    load = loads.as_load(part)
    for nothing in (Free(), Load(), Inertia(0.0), Constant(0.0), Spring(0.0)):
        same(load + nothing, load)


def test_none_is_a_free_shaft():
    assert loads.as_load(None) == Load() == loads.as_load(Free()) == Free() + Free()
    assert np.all(Load().external_torque(TIME, ANGLE) == 0.0)
    assert Load().time_span == (-math.inf, math.inf)


def test_springs_without_stiffness_do_not_leave_a_rest_angle():
    assert Spring(0.0, 1.0) + Inertia(1.0) == Inertia(1.0) + Spring(0.0, 1.0)
    assert Spring(0.0, 1.0) + Spring(0.0, 2.0) == Spring(0.0, 2.0) + Spring(0.0, 1.0)
    assert (Spring(0.0, 1.0) + Spring(2.0, 3.0)).elasticity == (2.0, 3.0)


# ---------------------------------------------------------------------------------------- each part

def test_signs():
    """Positive pushes towards -q: what pulls back from q > 0 is positive there."""
    t, q = np.zeros(3), np.array([-0.5, 0.0, 0.5])
    assert loads.as_load(Constant(0.1)).external_torque(t, q).tolist() == [0.1, 0.1, 0.1]
    assert np.sign(loads.as_load(Spring(2.0)).external_torque(t, q)).tolist() == [-1, 0, 1]
    assert np.sign(loads.as_load(Pendulum(0.1, 0.1)).external_torque(t, q)).tolist() == [-1, 0, 1]


@given(st.floats(0.01, 5.0), st.floats(0.01, 2.0), angles, angles)
def test_a_pendulum(mass, length, hanging, q):
    pendulum = Pendulum(mass=mass, length=length, hanging_angle=hanging)
    load = loads.as_load(pendulum)
    assert float(load.external_torque(0.0, q)) == pytest.approx(
        mass * 9.80665 * length * math.sin(q - hanging), abs=1e-12)
    assert load.total_inertia == pytest.approx(mass * length**2)
    assert load.inertia == 0.0
    assert load.pendulum == pendulum
    assert loads.as_load(Pendulum(mass, length, inertia=0.5)).total_inertia == 0.5
    assert loads.as_load(Pendulum(mass, length, inertia=0.0)).total_inertia == 0.0


@pytest.mark.parametrize("hanging", [0.0, 1.0, 3.0, -2.0])
def test_opposed_pendulums_balance(hanging):
    load = Pendulum(0.2, 0.1, hanging_angle=hanging) + Pendulum(0.1, 0.2, hanging_angle=hanging + math.pi)
    np.testing.assert_allclose(load.external_torque(TIME, ANGLE), 0.0, atol=1e-15)
    assert load.total_inertia == pytest.approx(0.2 * 0.01 + 0.1 * 0.04)


@given(st.floats(0.01, 5.0), angles, st.floats(0.01, 5.0), angles)
def test_two_springs_are_one_that_rests_where_they_balance(k1, r1, k2, r2):
    stiffness, rest = (Spring(k1, r1) + Spring(k2, r2)).elasticity
    assert stiffness == k1 + k2
    assert k1 * (rest - r1) == pytest.approx(-k2 * (rest - r2), abs=1e-12)


def test_a_recorded_torque_is_linear_between_samples():
    load = RECORD + Constant(0.5)
    t = np.array([0.0, 0.25, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(load.external_torque(t, np.zeros(5)), [0.5, 0.75, 1.5, 0.5, -0.5], rtol=1e-15)


def test_two_records_are_known_where_both_are():
    load = RECORD + Recorded([-1.0, 0.5, 2.0], [2.0, 2.0, 5.0])
    assert load.time_span == (0.0, 2.0)
    t = np.linspace(0.0, 2.0, 41)
    expected = np.interp(t, [0, 1, 3], [0, 1, -1]) + np.interp(t, [-1, 0.5, 2], [2, 2, 5])
    np.testing.assert_allclose(load.external_torque(t, np.zeros(41)), expected, rtol=1e-14)


def test_a_long_record_lowers_to_as_many_pieces():
    t = np.arange(20_001) * 1e-3
    load = loads.as_load(Recorded(t, np.sin(t)))
    assert len(load.torque_pieces.table) == 20_000
    np.testing.assert_allclose(load.torque_pieces(t[:-1]), np.sin(t[:-1]), atol=1e-15)


@pytest.mark.parametrize("time", [-1e-9, 3.0 + 1e-9, 1e9, [1.0, 4.0]])
def test_outside_its_record_a_load_is_not_known(time):
    with pytest.raises(LoadError, match="which the record covers") as caught:
        loads.as_load(RECORD).external_torque(time, np.zeros_like(time))
    assert str(caught.value).isprintable()


def test_a_run_may_not_leave_the_record(servo):
    model = servotwin.BoundedServo(servo)
    command = servotwin.signals.constant(90.0, unit="deg")
    servotwin.simulate(model, command, duration=3.0, load=RECORD)
    with pytest.raises(LoadError, match=r"0 to 3\.1 s', allowed: times from 0 to 3 s"):
        servotwin.simulate(model, command, duration=3.1, load=RECORD)


@pytest.mark.parametrize("other", [Recorded([3.0, 4.0], [0.0, 1.0]), Recorded([5.0, 6.0], [0.0, 1.0])])
def test_records_without_a_common_time(other):
    with pytest.raises(LoadError, match="do not overlap"):
        RECORD + other


def test_dotted_names():
    load = Inertia(1e-3) + Viscous(1e-4) + Constant(0.1) + Pendulum(mass=0.1, length=0.12) + Coulomb(0.02)
    assert (load.inertia, load.viscous_friction, load.torque, load.coulomb_torque) == (1e-3, 1e-4, 0.1, 0.02)
    assert load.pendulum.mass == 0.1
    assert (load + Spring(2.0, 0.5)).spring.stiffness == 2.0


@pytest.mark.parametrize("load", [Load(), Pendulum(0.1, 0.1) + Pendulum(0.1, 0.2)])
def test_the_pendulum_is_asked_for_where_there_is_not_one(load):
    with pytest.raises(LoadError, match="exactly one"):
        _ = load.pendulum
    with pytest.raises(LoadError, match="exactly one"):
        _ = load.spring


@given(several)
def test_loads_travel(items):
    load = added(items)
    load.external_torque(TIME, ANGLE)
    again = pickle.loads(pickle.dumps(load))
    assert again == load
    np.testing.assert_array_equal(again.external_torque(TIME, ANGLE), load.external_torque(TIME, ANGLE))


# ---------------------------------------------------------------------------------------- what is refused

BAD = [math.nan, math.inf, -math.inf, True, "1", None, [1.0], 1j, np.ones(1), 10**400]
MAKERS = {
    "Inertia(inertia)": Inertia, "Viscous(viscous_friction)": Viscous, "Constant(torque)": Constant,
    "Coulomb(coulomb_torque)": Coulomb, "Spring(stiffness)": Spring,
    "Spring(rest_angle)": lambda x: Spring(1.0, x), "Pendulum(mass)": lambda x: Pendulum(x, 1.0),
    "Pendulum(length)": lambda x: Pendulum(1.0, x), "Pendulum(inertia)": lambda x: Pendulum(1.0, 1.0, inertia=x),
    "Pendulum(hanging_angle)": lambda x: Pendulum(1.0, 1.0, hanging_angle=x),
    "Pendulum(gravity)": lambda x: Pendulum(1.0, 1.0, gravity=x),
}
SIGNED = {"Constant(torque)", "Spring(rest_angle)", "Pendulum(hanging_angle)"}


def refused(call, *words):
    with pytest.raises(LoadError) as caught:
        call()
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize("name", MAKERS)
def test_what_is_no_finite_number_is_refused(name):
    for value in BAD:
        if (name, value) != ("Pendulum(inertia)", None):  # then it is that of a point mass
            refused(lambda value=value: MAKERS[name](value), name, "finite number")


@pytest.mark.parametrize("name", MAKERS)
def test_signs_are_checked(name):
    if name in SIGNED:
        MAKERS[name](-1.0)
    else:
        refused(lambda: MAKERS[name](-1e-300), name, "at least 0")


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("number", [1, np.float32(0.1), np.int64(2), np.float64(0.5)])
def test_numbers_of_every_kind_become_floats(name, number):
    """A float32 left in place would lower the precision of the whole plant."""
    part = MAKERS[name](number)
    assert all(type(value) is float for value in vars(part).values() if value is not None)
    assert part == MAKERS[name](float(number))


@pytest.mark.parametrize(("time", "torque", "words"), [
    ([0.0], [0.0], ("at least 2",)), ([], [], ("at least 2",)), ([0.0, 1.0], [0.0], ("shapes (2,) and (1,)",)),
    ([[0.0, 1.0]], [[0.0, 1.0]], ("shapes",)), (0.0, 1.0, ("shapes",)), ([0.0, 0.0], [0.0, 1.0], ("increase",)),
    ([1.0, 0.0], [0.0, 1.0], ("increase",)), ([0.0, math.nan], [0.0, 1.0], ("finite",)),
    ([0.0, 1.0], [0.0, math.inf], ("finite",)), (["a", "b"], [0.0, 1.0], ("numbers",)),
    ([0.0, 1.0], [0.0, 1j], ("numbers",)), ([0.0, 1.0], [0.0, 10**400], ("numbers",)),
    ([0.0, 1.0], [[0.0], [1.0, 2.0]], ("numbers",)), (None, None, ("shapes",)),
])
def test_bad_records_are_refused(time, torque, words):
    refused(lambda: Recorded(time, torque), "Recorded", *words)


def test_a_record_too_steep_for_numbers():
    load = loads.as_load(Recorded([0.0, 1e-300], [0.0, 1e300]))
    refused(lambda: load.torque_pieces, "slope")


def test_a_record_does_not_follow_its_arrays():
    t, y = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    record = Recorded(t, y)
    y[:] = 7.0
    assert record.torque == (0.0, 1.0)


def test_a_body_behind_a_spring_is_not_on_the_shaft():
    load = Inertia(1e-3) + Flexible(stiffness=50.0, mass=0.1, length=0.2, damping=0.1)
    assert load.total_inertia == 1e-3
    assert load.flexible.moment_of_inertia == pytest.approx(4e-3)
    assert load.flexible.gravity_torque == pytest.approx(0.1 * 9.80665 * 0.2)
    assert load_from_words(words_of_load(load)) == load
    refused(lambda: load + Flexible(stiffness=1.0, inertia=1.0), "at most one")
    refused(lambda: Inertia(1.0).as_load().flexible, "exactly one")


@pytest.mark.parametrize(("words", "what"), [
    ({"stiffness": 0.0, "inertia": 1.0}, "Flexible(stiffness)"), ({"stiffness": -1.0, "inertia": 1.0}, "positive"),
    ({"stiffness": 1.0}, "Flexible(inertia)"), ({"stiffness": 1.0, "inertia": 0.0}, "Flexible(inertia)"),
    ({"stiffness": 1.0, "inertia": 1.0, "damping": -1.0}, "Flexible(damping)"),
    ({"stiffness": math.nan, "inertia": 1.0}, "Flexible(stiffness)")])
def test_a_body_behind_a_spring_is_checked(words, what):
    refused(lambda: Flexible(**words), what)


@pytest.mark.parametrize("thing", [3.0, "inertia", [Inertia(1.0)], Inertia, {}, servotwin])
def test_what_is_no_load_is_refused(thing, servo):
    refused(lambda: loads.as_load(thing), "a load of servotwin.loads")
    refused(lambda: Inertia(1.0) + thing)
    refused(lambda: Load() + thing)
    with pytest.raises(InputError):
        servotwin.Simulator(servotwin.BoundedServo(servo), thing)


@pytest.mark.parametrize("name", ["inertia", "viscous_friction", "coulomb_torque", "torque"])
@pytest.mark.parametrize("value", [math.nan, math.inf, "1", None, True])
def test_a_load_made_by_hand_is_checked(name, value):
    refused(lambda: Load(**{name: value}), f"load.{name}")


@given(sizes, sizes)
def test_energy_of_a_spring_is_recovered(k, rest):
    """A conservative torque does no work around a closed path."""
    assume(k > 0.0)
    q = np.concatenate([np.linspace(0.0, 2.0, 50), np.linspace(2.0, 0.0, 50)])
    load = Spring(k, rest) + Pendulum(0.3, 0.2)
    torque = load.external_torque(np.zeros(100), q)
    assert np.trapezoid(torque, q) == pytest.approx(0.0, abs=1e-9 * (1.0 + k))

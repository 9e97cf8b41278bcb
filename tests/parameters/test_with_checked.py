"""`Servo.with_checked` is `replace` without the checks: same servo, same quantities, and nothing shared is changed."""

import pickle
import warnings

import pytest

import servotwin as st

CHANGES = {
    "numbers": {"motor.rotor_inertia": 3e-8, "electronics.deadband": 5e-6, "motor.armature_resistance": 3.5},
    "a number that was absent": {"friction.breakaway_ratio": 1.2},
    "a number taken away": {"electronics.deadband": None},
    "a word": {"electronics.off_state": "coast"},
    "a table": {"potentiometer.linearity_angle": (0.0, 1.0), "potentiometer.linearity_error": (0.0, 0.01)},
    "nothing": {},
}


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES.keys())
def test_it_does_what_replace_does(servo, changes):
    before = pickle.dumps(servo)
    fast, plain = servo.with_checked(changes), servo.replace(changes)
    assert fast == plain
    assert tuple(fast.quantities.items()) == tuple(plain.quantities.items())
    assert fast.names() == plain.names()
    assert {name: fast.get(name) for name in changes} == {name: plain.get(name) for name in changes}
    assert pickle.loads(pickle.dumps(fast)) == plain
    assert pickle.dumps(servo) == before


def test_nothing_is_warned_of_what_a_search_tries(servo):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert servo.with_checked({"gear.backlash": 0.5}).gear.backlash == 0.5


def test_a_batch_still_names_the_lane_whose_number_is_bad(servo):
    with pytest.raises(st.errors.ParameterError, match="lane 1"):
        st.simulate_many(st.PulseServo(servo), st.signals.step(0.0, 60.0, unit="deg"), duration=0.1,
                         parameters={"motor.rotor_inertia": [3e-8, -1.0]})

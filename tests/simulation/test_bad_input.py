"""What the simulator refuses, each in one line, and what it cannot follow."""

import pytest

import servotwin as st
from servotwin import loads
from servotwin.errors import InputError, LoadError, SimulationError
from servotwin.simulation import Status

STEP = st.signals.step(0.0, 90.0, at=0.1, unit="deg")


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf"), True, "1", None, 10**400, [1.0]])
def test_durations(servo, bad):
    with pytest.raises(InputError, match="duration"):
        st.simulate(st.BoundedServo(servo), STEP, duration=bad)


@pytest.mark.parametrize("bad", [{"output_step": 0.0}, {"output_step": True}, {"output_step": "1"},
                                 {"output_step": 1e-12}, {"output_times": []}, {"output_times": [0.5, 0.1]},
                                 {"output_times": [2.0]}, {"output_times": ["a"]}, {"output_times": [1j]},
                                 {"output_times": [10**400]}, {"output_times": [0.1], "output_step": 0.1},
                                 {"initial": [1]}, {"initial": {"output_angle": "1"}},
                                 {"initial": {"output_angle": None}}, {"initial": {"output_angle": 100.0}},
                                 {"initial": {"angle": 0.0}}, {"seed": "a"}, {"seed": 1.5}])
def test_other_words(servo, bad):
    with pytest.raises(InputError) as caught:
        st.simulate(st.BoundedServo(servo), STEP, duration=1.0, **bad)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("bad", [None, 1.0, "bounded", st.BoundedServo])
def test_what_is_no_model_servo_command_load_or_state(servo, bad):
    sim = st.Simulator(st.BoundedServo(servo))
    with pytest.raises(InputError, match="model"):
        st.simulate(bad, STEP, duration=1.0)
    with pytest.raises(InputError, match="servo"):
        st.BoundedServo(bad)
    with pytest.raises(InputError, match="command"):
        sim.initial(bad)
    with pytest.raises(InputError, match="state"):
        sim.advance(bad, 1.0, STEP)
    if bad is not None:
        with pytest.raises(LoadError):
            st.Simulator(st.BoundedServo(servo), load=bad)


@pytest.mark.parametrize("until", [0.1, "1", None, True, float("inf"), 10**400])
def test_times_of_advance(servo, until):
    sim = st.Simulator(st.BoundedServo(servo))
    state = sim.advance(sim.initial(STEP), 0.2, STEP)
    with pytest.raises(InputError, match="until"):
        sim.advance(state, until, STEP)


def test_a_recorded_load_has_to_cover_the_run(servo):
    with pytest.raises(LoadError, match="covers"):
        st.simulate(st.BoundedServo(servo), STEP, duration=1.0, load=loads.Recorded([0.0, 0.5], [0.0, 0.1]))


@pytest.mark.parametrize(("load", "status"), [(loads.Spring(1e27), Status.TOO_FAST),
                                              (loads.Constant(1e307), Status.DIVERGED)])
def test_what_cannot_be_followed_ends_with_a_status(servo, load, status):
    model = st.BoundedServo(servo)
    result = st.simulate(model, STEP, duration=0.3, load=load, initial={"output_angle": 0.5, "output_speed": 1.0})
    assert result.status is status
    with pytest.raises(SimulationError, match=status.message):
        result.raise_if_failed()
    sim = st.Simulator(model, load=load)
    with pytest.raises(SimulationError):
        sim.advance(sim.initial(STEP, {"output_speed": 1.0}), 1.0, STEP)


def test_numbers_that_no_law_takes_end_a_run_with_a_status(servo):
    result = st.simulate(st.PulseServo(servo), STEP, duration=0.2, load=loads.Constant(1e307))
    assert result.status is Status.DIVERGED

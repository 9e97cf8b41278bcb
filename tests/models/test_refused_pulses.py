"""Models of the mean refuse commands of pulses that the chip refuses: at any time, naming the piece."""

import pytest

import servotwin as st
from servotwin.errors import CommandError
from servotwin.models.base import PULSE_RANGE

SERVO = st.load_servo("hitec-hs-755hb")
NARROW = SERVO.replace({"electronics.pulse_width_min": 0.9e-3, "electronics.pulse_width_max": 2.1e-3})
SILENT = SERVO.replace({"electronics.pulse_width_min": None, "electronics.pulse_width_max": None})
KINDS = [st.BoundedServo, st.AveragedServo, st.AveragedServoInductive]
REFUSED = {
    "seconds for microseconds": (SERVO, st.signals.constant(1500.0, unit="s"), 0, 0.0, 1.5e9),
    "too long": (SERVO, st.signals.step(1500.0, 2800.0, at=0.2, unit="us"), 1, 0.2, 2800.0),
    "too short": (SERVO, st.signals.step(1500.0, 250.0, at=0.2, unit="us"), 1, 0.2, 250.0),
    "after the end": (SERVO, st.signals.step(1500.0, 2800.0, at=7.0, unit="us"), 1, 7.0, 2800.0),
    "one sample": (SERVO, st.signals.samples([0.0, 0.1, 0.2], [1500.0, 3000.0, 1500.0], unit="us"), 1, 0.1, 3000.0),
    "sine": (SERVO, st.signals.sine(mean=1500.0, amplitude=1300.0, frequency=1.0, unit="us"), 0, 0.0, 200.0),
    "end of a ramp": (SERVO, st.signals.ramp(1500.0, 2750.0, at=0.1, over=0.5, unit="us"), 1, 0.1, 2750.0),
    "narrow": (NARROW, st.signals.step(1500.0, 2101.0, at=0.2, unit="us"), 1, 0.2, 2101.0),
    "usual bounds": (SILENT, st.signals.step(1500.0, 1e6 * PULSE_RANGE[1] + 1.0, at=0.2, unit="us"), 1, 0.2, 2701.0),
}
TAKEN = {
    "at the bounds": (NARROW, st.signals.step(900.0, 2100.0, at=0.2, unit="us")),
    "usual bounds": (SILENT, st.signals.step(300.0, 2700.0, at=0.2, unit="us")),
    "voltage": (NARROW, st.signals.step(0.0, 5.0, at=0.2, unit="V")),  # it enters without a pulse
    "angle": (NARROW, st.signals.step(-10.0, 190.0, at=0.2, unit="deg")),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", REFUSED)
def test_a_pulse_that_the_chip_refuses_is_bad_input(case, kind):
    servo, command, piece, start, got = REFUSED[case]
    with pytest.raises(CommandError, match=rf"piece {piece} of the command \(from {start:g} s on\)") as caught:
        st.simulate(kind(servo), command, duration=0.5)
    assert caught.value.got == f"{got:.6g} us"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", TAKEN)
def test_other_commands_are_taken(case, kind):
    servo, command = TAKEN[case]
    assert st.simulate(kind(servo), command, duration=0.5).status.ok


def test_the_error_names_the_lane():
    commands = [TAKEN["at the bounds"][1], st.signals.step(1500.0, 2101.0, at=0.2, unit="us")]
    with pytest.raises(CommandError, match=r"pulse width of lane 1, piece 1 of the command \(from 0.2 s on\)"):
        st.simulate_many(st.BoundedServo(NARROW), commands, duration=0.5)
    with pytest.raises(CommandError, match=r"pulse width of lane 2, piece 0 .* allowed: 300 to 1400 us"):
        st.simulate_many(st.BoundedServo(SERVO), st.signals.constant(1500.0, unit="us"), duration=0.5,
                         parameters={"electronics.pulse_width_max": [2.7e-3, 1.6e-3, 1.4e-3]})


@pytest.mark.parametrize("kind", KINDS)
def test_the_bounds_are_read(kind):
    model = kind(NARROW)
    assert {"electronics.pulse_width_min", "electronics.pulse_width_max"} <= {*model.optional}
    assert "electronics.pulse_width_min" not in model.ignored

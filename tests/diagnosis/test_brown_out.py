"""Boards on the supply of a servo: whether they brown out, and that each cure keeps them running."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet.holding import on_supply
from servotwin.diagnosis.api import BOARDS, MAY_RESET, RESETS, RUNS_ON, brown_out
from servotwin.errors import InputError, UnknownNameError

STEP = st.signals.step(-60.0, 60.0, at=0.1, unit="deg")


def model_of(name, supply):
    return st.PulseServo(on_supply(st.load_servo(name), st.Supply.of(supply)))


def asked(name, supply, board, **more):
    return brown_out(model_of(name, supply), STEP, board, load=st.loads.Load(), duration=0.5, **more)


@pytest.mark.parametrize(("supply", "board", "outcome"), [
    ("5V:0.2A", "uno", RESETS), ("usb", "uno", RUNS_ON), ("usb", "esp32", RESETS), ("usb", "esp32-ldo", RUNS_ON),
    ("5V:2.5ohm", "esp32", MAY_RESET), ("5V:3ohm", "nano", RUNS_ON), ("5V", "esp32", RUNS_ON)])
def test_a_board_resets_below_its_detector_and_its_regulator(supply, board, outcome):
    found, alone = asked("towerpro-sg90", supply, board), st.simulate(
        model_of("towerpro-sg90", supply), STEP, duration=0.5, output_step=0.5)
    least = 5.0 if alone.sag is None else alone.sag.voltage
    place = BOARDS[board]
    assert found.voltage == least
    assert found.outcome == outcome
    assert outcome == (RESETS if least < place.lower else MAY_RESET if least < place.upper else RUNS_ON)
    assert bool(found.cures) == (outcome != RUNS_ON)


@pytest.mark.parametrize(("supply", "said"), [("5V:0.2A", "a source that gives 0.4"), ("5V:3ohm", "at most 1.")])
def test_a_cure_is_the_least_change_that_keeps_it_running(supply, said):
    """Put into the servo it holds the detector's upper end, and a tenth less of it does not."""
    found = asked("towerpro-sg90", supply, "esp32" if "ohm" in supply else "uno")
    cure, *_, own = found.cures
    assert cure.words.startswith(said)
    assert cure.voltage == pytest.approx(found.board.upper, abs=0.01)
    assert cure.voltage >= found.board.upper
    assert (own.words, math.isnan(own.voltage)) == ("a supply of its own for the servo, with the grounds joined", True)
    name = "supply.internal_resistance" if "ohm" in supply else "supply.current_limit"
    value = float(next(word for word in cure.words.split() if word[0].isdigit()))
    less = model_of("towerpro-sg90", supply).servo.replace({name: value * (1.1 if "ohm" in supply else 0.9)})
    result = st.simulate(st.PulseServo(less), STEP, duration=0.5, output_step=0.5)
    assert result.sag.voltage < found.board.upper


def test_a_log_is_looked_at_too():
    time = np.arange(0.0, 1.0, 0.02)
    volts = np.where(np.abs(time - 0.5) < 0.05, 2.2, 5.0)
    log = st.Log(name="a", time=time, command=np.where(time < 0.1, 1.5e-3, 1.6e-3), command_kind="pulse_width",
                 measured={"output_angle": 0.1 * time, "bus_voltage": volts})
    found = asked("towerpro-sg90", "5V", "uno", log=log)
    assert (found.outcome, found.log_outcome, found.log_voltage) == (RUNS_ON, RESETS, 2.2)
    assert found.log_time == pytest.approx(0.46, abs=0.011)


def test_bad_input_is_refused():
    with pytest.raises(UnknownNameError, match="unknown board 'unno'; did you mean 'uno'"):
        asked("towerpro-sg90", "5V", "unno")
    with pytest.raises(InputError, match="which has no supply"):
        brown_out(st.AveragedServo(st.load_servo("towerpro-sg90")), STEP, "uno", load=st.loads.Load(), duration=0.5)

"""Digital servos with extreme numbers: they come to an end, stay finite and make no energy; lanes are no different."""

import signal

import numpy as np
import pytest

import servotwin as st
from leg_extremes import Extreme, extreme, pressed

pytestmark = pytest.mark.long

BLOCK, BLOCKS, PRESSED = 50, 40, 50
WORK = 30.0  # s of this process; most take 0.01, those of which a step is integrated a few
MOST_MOTIONS, MOST_EVENTS = 60_000, 5_000  # of a run of at most 40 ticks; stiff ones are integrated in small steps
KNOWN = {  # what is not as it should be
    1293,  # the motor's rate is 1e8 1/s, and `energy` takes a minute
    1843}  # the motor's rate is 7e5 1/s, and what is integrated takes half a minute
SEEN = ("output_angle", "output_speed", "motor_angle", "armature_current", "load_torque")
LOSSES = ("winding", "bridge", "brush", "friction", "stops")

HELD = 1336


class EndlessError(Exception):
    """A run that takes far longer than any should."""


def run(one: Extreme) -> st.Result:
    """Return a run; one without end raises."""
    def stop(*_: object) -> None:
        raise EndlessError

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, WORK)
    try:
        return st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial={"output_angle": 0.0},
                           output_step=one.duration / 20.0)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def check(seed: int, drawn=extreme) -> None:
    one = drawn(seed)
    result = run(one)
    assert result.status.ok, (seed, result.status, result.ended)
    assert result.stats.motions <= MOST_MOTIONS, seed
    assert len(result.events) <= MOST_EVENTS, seed
    assert all(np.isfinite(result[name]).all() for name in SEEN), seed
    energy = result.energy
    turnover = abs(energy.supply) + abs(energy.load)
    assert abs(energy.residual) <= 1e-8 * turnover + 1e-13, (seed, energy)
    assert min(getattr(energy, name) for name in LOSSES) >= -1e-9 * turnover - 1e-15, (seed, energy)
    assert energy.stored <= energy.supply - min(energy.load, 0.0) + 1e-8 * turnover + 1e-13, (seed, energy)
    lanes = st.simulate_many(one.model, one.command, duration=one.duration, load=one.load,
                             output_step=one.duration / 20.0, initial={"output_angle": 0.0})
    assert lanes.ok, seed
    np.testing.assert_allclose(lanes["output_angle"][0], result["output_angle"], rtol=1e-9, atol=1e-9,
                               err_msg=str(seed))


@pytest.mark.parametrize("seed", range(12))
def test_some_extreme_servos(seed):
    check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_extreme_servos(block):
    for seed in range(BLOCK * block, BLOCK * (block + 1)):
        if seed not in KNOWN:
            check(seed)


def test_servos_pressed_onto_a_stop_rest_there():
    """A motor too weak to lift its output off a stop bounced between both without end, each time by a rounding."""
    for seed in range(PRESSED):
        check(seed, pressed)


def test_servos_pressed_onto_their_stops_on_one_supply_rest_there():
    for seed in range(0, 5 * PRESSED, 2):
        servos = {str(k): pressed(k, analog=True) for k in (seed, seed + 1)}
        fleet = st.simulate_bus({name: (one.model, one.command, one.load) for name, one in servos.items()},
                                supply=st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2), duration=0.3)
        for name in servos:
            assert fleet[name].status.ok, (name, fleet[name].status)
            assert len(fleet[name].events) <= MOST_EVENTS, name


def test_motor_and_output_that_meet_in_no_time_are_held_together():
    """With a load friction of 0.9995 they part and meet at one instant: in `simulate`, in lanes, and it is told."""
    check(HELD)
    result = run(extreme(HELD))
    told = [event.time for event in result.events if event.kind == "gear held"]
    assert len(told) == result.stats.held > 0

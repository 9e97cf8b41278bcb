"""Numbers of programs on a shared supply are taken in place, as if all lanes had been laid out anew."""

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.lanes.lane_numbers import TUNED, LaneNumbers

SUPPLY = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.2)


def simulator(**more):
    return st.VectorSimulator(st.DigitalServo(st.load_servo("feetech-sts3215-12v")), 3, threads=1, **more)


def run(sims):
    sims.reset(command_angle=0.0)
    seen = []
    for k in range(60):
        sims.advance(3.3e-3, command_angle=[0.5, 1.0, -0.5])
        if k == 10:
            sims.set(parameters={"firmware.speed_limit": [0.5, 2.0]}, lanes=[0, 2])
        if k == 20:
            sims.set(parameters={"firmware.proportional_gain": 2.0, "firmware.trip_current": 1.0}, lanes=[1])
        if k == 30:
            sims.set(parameters={"firmware.deadband_angle": 0.01})
        if k == 40:
            sims.set(parameters={"load.inertia": 1e-3}, lanes=[1])
        seen.append([sims["output_angle"], sims["duty"], sims["reference_angle"]])
    return np.array(seen), sims._numbers.columns.firmware.copy()


def test_in_place_is_as_anew(monkeypatch):
    quick, firmware = run(simulator(bus=SUPPLY))
    monkeypatch.setattr(LaneNumbers, "retuned", lambda self, which, parameters: False)
    slow, others = run(simulator(bus=SUPPLY))
    assert firmware.tobytes() == others.tobytes()
    np.testing.assert_allclose(quick, slow, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", sorted(TUNED))
def test_each_of_them(name, monkeypatch):
    def program():
        sims = simulator(bus=SUPPLY)
        had = sims._numbers.model.servo.get(name)
        if had is not None:
            sims.set(parameters={name: 0.9 * had}, lanes=[1])
        return sims._numbers.columns.firmware.tobytes()

    quick = program()
    monkeypatch.setattr(LaneNumbers, "retuned", lambda self, which, parameters: False)
    assert quick == program()


def test_bad_numbers_change_nothing():
    sims = simulator(bus=SUPPLY)
    before = sims._numbers.columns.firmware.tobytes()
    for value in (-1.0, np.nan, [1.0, 2.0]):
        with pytest.raises(st.errors.ServotwinError):
            sims.set(parameters={"firmware.speed_limit": value}, lanes=[0])
    assert sims._numbers.columns.firmware.tobytes() == before


@pytest.mark.long
def test_elsewhere_they_are_laid_out_anew():
    sims = simulator()
    assert not sims._numbers.retuned(np.arange(3), {"firmware.speed_limit": 1.0})
    sims.set(parameters={"firmware.speed_limit": 1.0})

"""Other numbers of some lanes are taken in place, as if all lanes had been laid out anew."""

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.lanes.lane_numbers import TUNED, LaneNumbers
from servotwin.simulation.lanes.store import Store

HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0}
SERVOS = {  # by the kernels in which they run
    "one formula": (st.PulseServo, "hitec-hs-755hb", {}),
    "bands": (st.PulseServo, "hitec-hs-422", {}),
    "gaps": (st.PulseServo, "geekservo-2kg", {}),
    "strides": (st.PulseServo, "hitec-hs-755hb", HEAT),
    "coils": (st.PulseServoInductive, "hitec-hs-755hb", {}),
    "bounded": (st.BoundedServo, "hitec-hs-755hb", {}),
    "legs": (st.DigitalServo, "feetech-sts3215-12v", {}),
    "series": (st.DigitalServo, "feetech-sts3215-12v", HEAT),
    "ticks": (st.DigitalServo, "dsservo-ds3218", {})}
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


def drawn_run(kind, name, changes, seed):
    """Run lanes whose numbers change at random; return all that shows, and whether they were taken in place."""
    rng, model, lanes = np.random.default_rng(seed), kind(st.load_servo(name).replace(changes)), 6
    groups = ("motor.", "friction.", "electronics.deadband", "supply.bridge", "gear.output_inertia", "thermal.")
    names = [each for each in (*model.requires, *model.optional) if each.startswith(groups)
             and (model.servo.get(each) or 0.0) != 0.0 and "breakaway" not in each]
    load = [st.loads.Inertia(1e-4 * (1 + k % 2)) for k in range(lanes)]
    sims = st.VectorSimulator(model, lanes, load=load, threads=1,
                              parameters={names[0]: model.servo.get(names[0]) * rng.uniform(0.9, 1.1, lanes)})
    sims.reset(command_angle=0.1)
    seen = []
    for k in range(40):
        sims.advance(rng.uniform(1e-3, 9e-3), command_angle=rng.uniform(0.0, 0.7, lanes))
        if k % 5 == 2:
            which = np.flatnonzero(rng.random(lanes) < 0.4)
            if len(which):
                sims.set(lanes=which, parameters={
                    each: model.servo.get(each) * rng.uniform(0.9, 1.1, len(which))
                    for each in rng.choice(names, 3, replace=False)} | {"load.inertia": rng.uniform(1e-4, 3e-4)})
        if k % 10 == 5:
            sims.set(load_inertia=rng.uniform(1e-4, 3e-4), lanes=[rng.integers(lanes)])
        if k == 25:
            sims.reset(lanes=[1, 3], command_angle=0.2)
        seen.append([sims[each] for each in sims.signals if each != "trip"])
    return np.array(seen)


@pytest.mark.parametrize("form", SERVOS)
def test_other_numbers_of_some_lanes_are_taken_in_place(form, monkeypatch):
    kind, name, changes = SERVOS[form]
    taken, takes = [], Store.takes

    def counted(self, part, which, names):
        taken.append(takes(self, part, which, names))
        return taken[-1]

    monkeypatch.setattr(Store, "takes", counted)
    quick = drawn_run(kind, name, changes, 1)
    assert taken
    assert all(taken)
    monkeypatch.setattr(Store, "takes", lambda self, part, which, names: False)
    np.testing.assert_allclose(quick, drawn_run(kind, name, changes, 1), rtol=1e-9, atol=1e-9)


def test_lanes_beside_those_that_change_keep_their_bits():
    seen = []
    for changes in (False, True):
        sims = st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), 4, threads=1)
        sims.reset(command_angle=0.1)
        for k in range(9):
            sims.advance(7.3e-3, command_angle=0.5)
            if changes:
                sims.set(parameters={"motor.armature_resistance": 3.0 + 0.1 * k}, lanes=[0, 2])
        seen.append(sims["output_angle"])
    assert np.array_equal(seen[0][[1, 3]], seen[1][[1, 3]])
    assert not np.any(seen[0][[0, 2]] == seen[1][[0, 2]])


def test_play_comes_and_goes_in_place(monkeypatch):
    """Of servos that run by the same kernels with it and without."""
    def run():
        sims = st.VectorSimulator(st.DigitalServo(st.load_servo("feetech-sts3215-12v")), 3, threads=1, parameters={
            "gear.backlash": [0.0, 0.02, 0.02], "gear.output_inertia": 1e-4})
        sims.reset(command_angle=0.0)
        seen = []
        for k in range(40):
            sims.advance(3e-3, command_angle=0.4 if k % 20 < 10 else 0.1)
            if k == 12:
                sims.set(parameters={"gear.backlash": [0.02, 0.0]}, lanes=[0, 1])
            seen.append([sims[name] for name in ("output_angle", "motor_angle", "output_speed")])
        return np.array(seen)

    quick = run()
    monkeypatch.setattr(Store, "takes", lambda self, part, which, names: False)
    np.testing.assert_allclose(quick, run(), rtol=1e-9, atol=1e-9)
    reduction = st.load_servo("feetech-sts3215-12v").get("gear.gear_reduction")
    apart = np.abs(quick[:, 1] / reduction - quick[:, 0])
    assert apart[13:, 1].max() < 1e-12 < 1e-3 < apart[13:, 0].max()


def test_lanes_keep_their_own_loads():
    """A number of a load that changes in one lane leaves those of the others."""
    loads = [st.loads.Inertia(1e-4), st.loads.Inertia(2e-4), st.loads.Inertia(3e-4)]
    sims = st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), 3, load=loads)
    sims.set(parameters={"load.inertia": 5e-4}, lanes=[1])
    assert sims._numbers.load_total.tolist() == [1e-4, 5e-4, 3e-4]
    sims.set(parameters={"load.viscous_friction": 1e-3, "gear.backlash": 0.02, "gear.output_inertia": 1e-5})
    assert sims._numbers.load_total.tolist() == [1e-4, 5e-4, 3e-4]


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

"""Digital servos by coupled power series, on a shared supply or warm: against the general engine, cut and reordered."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import servotwin as st
from leg_draws import drawn, goals, spread
from servotwin.models.engine.legs import coupled_legs, coupled_ticks, coupled_units
from servotwin.models.engine.legs.coupled_units import Coupling, Unit, put_unit_numbers
from servotwin.models.engine.memory import FRAMES
from servotwin.models.state.modes import BACKWARD, FORWARD
from servotwin.models.state.records import object_of
from servotwin.models.terms.source import Source
from simulation.test_bus_digital import LOAD, digital

SERVOS, STEPS, EVERY = 3, 12, 0.02  # on a bus; new goals every so many seconds
ELSEWHERE = ("elastic gear", "spring", "silence")  # by the general engine; a goal that is written over and over
SEEDS = (*range(10), 17, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(10, 60)
                           if seed not in (17, 19)))
# In 19 a program starts anew, and hears a goal only where that is written again
WARM = {"thermal.winding_capacity": 1.5, "thermal.housing_capacity": 40.0, "thermal.winding_to_housing": 6.0,
        "thermal.housing_to_ambient": 12.0, "thermal.magnet_coefficient": -1.2e-3}
SIGNALS = ("output_angle", "output_speed")
ACCURATE = {"output_angle": 1e-10, "output_speed": 1e-8, "armature_current": 1e-8, "winding_temperature": 1e-10}


class Bus:
    """Random servos of one kind on one supply: what differs, and what they are told."""

    def __init__(self, seed, servos=SERVOS, without=ELSEWHERE):
        self.model, load, self.terms = drawn(seed, without=without)
        rng = np.random.default_rng((seed, 9))
        if rng.random() < 0.4:
            self.model = st.DigitalServo(self.model.servo.replace(WARM))
        own = spread(self.model, servos, seed)
        own["load.inertia"] = 10.0 ** rng.uniform(-3.3, -2.2, servos)
        if rng.random() < 0.5:
            own["firmware.control_phase"] = rng.uniform(0.0, 1e-3, servos)
        self.own, self.load = own, load
        self.goals = goals(self.model, seed, STEPS, servos)
        self.supply = st.Supply(open_circuit_voltage=self.model.servo.supply.open_circuit_voltage,
                                internal_resistance=float(rng.uniform(0.05, 0.6)),
                                current_limit=float(rng.uniform(1.0, 4.0)) if rng.random() < 0.3 else None)

    def lanes(self, cuts=1, order=None):
        """Return angles and speeds at the steps (steps, 2, servos), of lanes in an order."""
        servos = self.goals.shape[1]
        order = np.arange(servos) if order is None else order
        sims = st.VectorSimulator(self.model, servos, load=self.load, bus=self.supply, threads=1,
                                  parameters={name: value[order] for name, value in self.own.items()})
        sims.reset(command_angle=np.zeros(servos))
        found = np.empty((STEPS, 2, servos))
        for k in range(STEPS):
            for _ in range(cuts):
                sims.advance(EVERY / cuts, command_angle=self.goals[k, order])
            for n, name in enumerate(SIGNALS):
                found[k, n, order] = sims[name]
        return found

    def servos(self):
        """Return the same by `simulate_bus`."""
        at = EVERY * np.arange(STEPS)
        fleet = {}
        for k in range(self.goals.shape[1]):
            numbers = {name: float(value[k]) for name, value in self.own.items()}
            inertia, torque = numbers.pop("load.inertia"), numbers.pop("load.torque")
            load = st.loads.Inertia(inertia) + st.loads.Constant(torque) + st.loads.Coulomb(
                self.load.coulomb_torque) + st.loads.Viscous(self.load.viscous_friction)
            told = st.signals.samples(np.concatenate([[-EVERY], at]), np.concatenate([[0.0], self.goals[:, k]]),
                                      unit="rad", hold="previous")
            fleet[f"servo {k}"] = (st.DigitalServo(self.model.servo.replace(numbers)), told, load)
        found = st.simulate_bus(fleet, supply=self.supply, duration=EVERY * STEPS,
                                output_times=EVERY * np.arange(1, STEPS + 1))
        found.raise_if_failed()
        return np.stack([[found[name][signal] for name in fleet] for signal in SIGNALS]).transpose(2, 0, 1)


@pytest.mark.long(but="7")
@pytest.mark.parametrize("seed", SEEDS)
def test_lanes_on_a_supply_are_the_servos_of_simulate_bus(seed):
    bus = Bus(seed)
    lanes, servos = bus.lanes(), bus.servos()
    np.testing.assert_allclose(lanes[:, 0], servos[:, 0], rtol=0.0, atol=2e-9)
    np.testing.assert_allclose(lanes[:, 1], servos[:, 1], rtol=0.0, atol=2e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_how_time_is_cut_changes_rounding_alone(seed):
    bus = Bus(seed)
    np.testing.assert_allclose(bus.lanes(cuts=20), bus.lanes(), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_servos_changes_rounding_alone(seed):
    bus = Bus(seed, without=(*ELSEWHERE, "potentiometer"))  # whose noise goes by the number of the lane
    np.testing.assert_allclose(bus.lanes(order=np.arange(SERVOS)[::-1]), bus.lanes(), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("periods", [(1e-3, 1e-3), (1e-3, 1.3e-3)], ids=["one clock", "two clocks"])
@pytest.mark.parametrize("limit", [0.3, 1.2])
def test_a_supply_at_its_limit_goes_on_under_the_duties_that_programs_have_put(limit, periods):
    """One servo drives, the other is unplugged: its motion began before the call, and under another duty."""
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    supply = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.3, current_limit=limit)
    goals, found = np.random.default_rng(0).uniform(-1.0, 1.0, STEPS), {}
    for cuts in (1, 7, 20):
        sims = st.VectorSimulator(model, 2, load=st.loads.Inertia(4e-3) + st.loads.Constant(0.1), bus=supply, threads=1,
                                  parameters={"firmware.control_period": np.array(periods)})
        sims.reset(command_angle=0.0)
        sims.set(torque_enable=[True, False])
        found[cuts] = np.empty((STEPS, 2))
        for k in range(STEPS):
            for _ in range(cuts):
                sims.advance(EVERY / cuts, command_angle=goals[k])
            found[cuts][k] = sims["output_angle"]
    for cuts in (7, 20):
        np.testing.assert_allclose(found[cuts], found[1], rtol=0.0, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_a_warm_lane_is_the_servo_alone(seed):
    model, load, _ = drawn(seed, without=ELSEWHERE)
    limit = {"supply.current_limit": 1.2} if seed % 3 == 0 else {}
    model, told = st.DigitalServo(model.servo.replace({**WARM, **limit})), goals(model, seed, STEPS, 1)[:, 0]
    command = st.signals.samples(EVERY * np.arange(STEPS), told, unit="rad", hold="previous")
    times = np.arange(0.0, EVERY * STEPS, 1.7e-3)
    asked = {"duration": EVERY * STEPS, "load": load, "output_times": times, "accuracy": 1e-13}
    one = st.simulate(model, command, **asked).raise_if_failed()
    lane = st.simulate_many(model, command, outputs=tuple(ACCURATE), **asked)
    for name, most in ACCURATE.items():
        np.testing.assert_allclose(lane[name][0], one[name], rtol=0.0, atol=most)


def test_a_warm_lane_goes_on_where_its_times_count_anew():
    """Twice in a call."""
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace(WARM))
    duration = 2.5 * FRAMES * model.servo.get("firmware.control_period")
    command = st.signals.samples([0.0, 0.2, 0.45], [0.1, 0.5, 0.2], unit="rad", hold="previous")
    asked = {"duration": duration, "load": st.loads.Inertia(1e-3), "output_times": np.linspace(0.0, duration, 23)}
    one, lane = st.simulate(model, command, **asked), st.simulate_many(model, command, **asked)
    np.testing.assert_allclose(lane["output_angle"][0], one["output_angle"], rtol=0.0, atol=1e-10)


@pytest.mark.long
def test_a_winding_that_rests_cools_by_its_two_exponentials():
    """The closed form of two thermal masses, against lanes of which nothing moves."""
    servo = st.load_servo("feetech-sts3215-12v").replace({**WARM, "thermal.ambient": 293.15})
    model, load = st.DigitalServo(servo), st.loads.Inertia(1e-3)
    times = np.linspace(0.0, 60.0, 7)
    found = st.simulate_many(model, st.signals.constant(0.0, unit="rad"), duration=60.0, load=load, output_times=times,
                             initial={"output_angle": 0.0, "winding_temperature": 340.0},
                             outputs=("winding_temperature", "housing_temperature"))
    thermal = servo.thermal
    between, out = 1.0 / thermal.winding_to_housing, 1.0 / thermal.housing_to_ambient
    law = np.array([[-between / thermal.winding_capacity, between / thermal.winding_capacity],
                    [between / thermal.housing_capacity, -(between + out) / thermal.housing_capacity]])
    start = np.array([340.0, 293.15]) - 293.15
    expected = np.stack([expm(law * t) @ start for t in times]) + 293.15
    np.testing.assert_allclose(found["winding_temperature"][0], expected[:, 0], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found["housing_temperature"][0], expected[:, 1], rtol=0.0, atol=1e-9)


def test_how_much_a_series_bends_is_bounded_by_its_coefficients():
    """Two servos that speed up on one battery: h² |d²w/dt²| and h² |d²V/dt²| along a leg, by differences."""
    model = digital({"motor.motor_viscous_friction": 1e-7})
    units, common, h = [object_of(Unit), object_of(Unit)], object_of(Coupling), 5e-3
    coupled_ticks.put_source(common, Source(12.0, 0.7, math.inf))
    for unit, own in zip(units, (0.9, -0.4), strict=True):
        put_unit_numbers(unit.given, model.pack(LOAD))
        unit.torque, unit.y.T_w, unit.y.T_h = 0.0, 298.15, 298.15
        coupled_legs.put_duty(unit, own)
    assert coupled_legs.settle(units, 2, common) == coupled_legs.DONE
    coupled_units.work_out(units, 2, common, h)
    times = np.linspace(0.0, h, 9)
    step = times[1]
    for unit in units:
        w = np.array([coupled_units.state_at(unit, common.terms, t).w for t in times])
        most = h**2 * np.abs(np.diff(w, 2)).max() / step**2
        assert 0.0 < most <= unit.bend <= 3.0 * most
    V = np.array([coupled_units.voltage_at(common, t) for t in times])
    most = h**2 * np.abs(np.diff(V, 2)).max() / step**2
    assert 0.0 < most <= common.bend <= 3.0 * most
    # so that a speed that ends as it began, with room for a turn between, does not surely keep its way
    assert coupled_legs._keeps_way(FORWARD, [1e-3, 0.0], 1e-3, 1e-3, 1e-4, h)
    assert not coupled_legs._keeps_way(FORWARD, [1e-6, 0.0], 1e-6, 1e-6, 1e-4, h)
    assert not coupled_legs._keeps_way(BACKWARD, [1e-3, 0.0], 1e-3, 1e-3, 0.0, h)

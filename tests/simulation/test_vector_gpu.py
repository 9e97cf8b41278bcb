"""`VectorSimulator` on a GPU: what it is given and gives, beside the same lanes on the processor.

By the driver where there is one, else by a stand-in for it (`test_cuda`).
"""

import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, InputError, UnknownNameError
from servotwin.simulation.compile import threads
from servotwin.simulation.lanes.lane_threads import ThreadedLanes
from servotwin.simulation.lanes.vector_gpu import VectorSimulatorOnGpu
from simulation.test_cuda import Guest, built, driver, needs_compilers, shared
from simulation.test_lane_threads import GOALS, PLAIN, WARM

__all__ = ["built", "driver", "shared"]  # fixtures

pytestmark = needs_compilers
LANES = 24
NUMBERS = {"electronics.deadband": np.linspace(3e-6, 2e-5, LANES)}


def both(driver, model=None, dtype="float64", **more):
    """Return the same lanes on the processor and on the GPU."""
    model = model or st.PulseServo(st.load_servo(PLAIN))
    own = {"load": st.loads.Load(inertia=1e-3, torque=0.02), "seed": 3, **more}
    here = st.VectorSimulator(model, LANES, **own)
    for text in ThreadedLanes(here._numbers, dtype)._texts:
        driver.library.stand_in_library(threads.library(text)._name.encode())
    return here, st.VectorSimulator(model, LANES, **own, dtype=dtype, device="cuda")


def same(here, there, *, within=1e-11):
    for name in ("output_angle", "output_speed", "time"):
        scale = max(1.0, np.abs(here[name]).max())
        assert there[name].read() == pytest.approx(here[name], abs=within * scale), name


FADING = {"friction.stribeck_speed": 20.0, "friction.breakaway_ratio": 1.4, "supply.current_limit": 0.8}


@pytest.mark.parametrize("model", [
    None, pytest.param(st.DigitalServo(st.load_servo(GOALS)), marks=pytest.mark.slow),
    pytest.param(st.PulseServo(st.load_servo(PLAIN).replace(FADING)), marks=pytest.mark.slow),
    pytest.param(st.DigitalServo(st.load_servo(GOALS).replace(WARM)), marks=pytest.mark.slow)])
def test_numbers_that_are_given_are_those_of_the_processor(driver, model):
    here, there = both(driver, model, **({} if model else {"parameters": NUMBERS}))
    assert isinstance(there, VectorSimulatorOnGpu)
    assert len(there) == LANES
    rng, within = np.random.default_rng(1), 1e-11 if model is None else 1e-9
    same(here, there)
    for k in range(8):
        angles, some = rng.uniform(0.4, 1.1, LANES), np.flatnonzero(rng.random(LANES) < 0.4)
        for each in (here, there):
            each.advance(0.0137, command_angle=angles, external_torque=0.01 if k == 3 else None)
            if k % 3 == 1:
                each.reset(command_angle=angles[some], output_angle=0.6, lanes=some)
            if k % 3 == 2:
                each.set(output_speed=angles[some], load_inertia=2e-3, lanes=some)
                each.advance(0.01)  # as told before
        same(here, there, within=within)
    for name in there.signals:
        scale = max(1.0, np.abs(here[name]).max())
        assert there[name].read() == pytest.approx(here[name], abs=1e-6 * scale), name
    assert there.status.read().tolist() == here.status.tolist()


def test_arrays_of_the_gpu_are_taken_in_place_and_nothing_is_allocated(shared):
    here, there = both(shared)
    angles, mask = np.linspace(0.3, 1.2, LANES), np.arange(LANES) % 3 == 0
    guests = {"command_angle": Guest(angles), "external_torque": Guest(np.full(LANES, 0.01))}
    held = shared["bytes"]
    seen = np.from_dlpack(there["output_angle"])
    there.advance(0.02, **guests, stream=9)
    here.advance(0.02, command_angle=angles, external_torque=0.01)
    there.reset(command_angle=Guest(angles[::-1].copy()), output_angle=Guest(np.full(LANES, np.nan)), lanes=Guest(mask))
    here.reset(command_angle=angles[::-1][mask], lanes=mask)
    there.set(output_speed=Guest(np.where(mask, np.nan, 1.0)))
    here.set(output_speed=1.0, lanes=~mask)
    there.advance(0.05)
    here.advance(0.05)
    assert seen == pytest.approx(here["output_angle"], abs=1e-12)
    current = np.from_dlpack(there["armature_current"])
    assert current == pytest.approx(here["armature_current"], abs=1e-9)
    assert shared["bytes"] == held
    assert guests["command_angle"].streams == [9]
    there.advance(0.05, command_angle=Guest(np.where(mask, np.nan, 0.5)))  # which no servo takes
    assert (there.status.read() != 0).tolist() == mask.tolist()
    assert [(one.lane, one.cause) for one in there.failures] == [
        (lane, st.Status.REFUSED.message) for lane in np.flatnonzero(mask)]
    assert np.isnan(seen).tolist() == mask.tolist()


def test_a_bus_voltage_that_the_bridge_drops_fails_its_lane_until_another_comes(shared):
    volts, mask = np.full(LANES, 6.0), np.arange(LANES) == 3
    _, there = both(shared, variants={"electronics.deadband": [4e-6, 8e-6]})
    volts[3] = 0.0
    there.set(bus_voltage=Guest(volts))
    for lanes in (None, Guest(mask), Guest(np.array([3]))):
        assert np.flatnonzero(there.status.read()).tolist() == [3]
        there.reset(command_angle=0.5, lanes=lanes)
    there.set(bus_voltage=6.0, lanes=[3])
    assert there.status.read()[3] != 0
    with pytest.raises(InputError, match=r"^torque_enable of PulseServo"):
        there.set(torque_enable=Guest(mask))


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_numbers_of_lanes_are_those_of_their_call_alone(shared, dtype):
    _, there = both(shared)
    for lane in (5, 7, 2):
        there.set(output_speed=0.0)
        there.set(output_speed=1.0, lanes=Guest(np.array([lane, LANES, -1], dtype)))
        assert np.flatnonzero(there["output_speed"].read()).tolist() == [lane]
    there.set(output_speed=2.0, lanes=Guest(np.zeros(0, dtype)))
    assert there["output_speed"].read().max() == 1.0


def test_numbers_beside_a_mask_of_the_gpu_are_checked(shared):
    _, there = both(shared)
    mask = Guest(np.ones(LANES, bool))
    for call, name, value in ((there.set, "load_inertia", -1.0), (there.reset, "output_angle", 9.0)):
        with pytest.raises(InputError, match=f"^{name} of lane 0: got {value}"):
            call(**{name: value}, lanes=mask)
    assert not there.status.read().any()


@pytest.mark.parametrize(("model", "more"), [
    (None, {"parameters": NUMBERS}),
    pytest.param(st.DigitalServo(st.load_servo(GOALS).replace(WARM)), {}, marks=pytest.mark.slow)])
def test_what_was_saved_continues_there_and_on_the_processor(driver, model, more):
    here, there = both(driver, model, **more)
    angles = np.linspace(0.3, 1.2, LANES)
    there.advance(0.033, command_angle=angles, external_torque=0.03)
    memory = pickle.loads(pickle.dumps(there.save()))
    here.restore(memory)
    for each in (here, there):
        each.advance(0.05)
    same(here, there)
    if model is not None:  # what it remembers is warmer than where it began
        assert there["winding_temperature"].read() == pytest.approx(here["winding_temperature"], abs=1e-9)
        assert (there["winding_temperature"].read() - there["housing_temperature"].read()).max() > 0.01
    after = there["output_angle"].read()
    there.restore(memory)
    there.advance(0.05)
    assert np.array_equal(there["output_angle"].read(), after)
    there.restore(here.save())
    for each in (here, there):
        each.advance(0.05)
    same(here, there)


@pytest.mark.parametrize(("call", "error", "words"), [
    (lambda sims: sims.advance(np.nan), InputError, r"^advance\(duration\): got nan"),
    (lambda sims: sims.advance(0.1, command_angle=[0.5]), InputError, r"^command_angle: got 'an array of shape"),
    (lambda sims: sims.advance(0.1, command_angle=np.full(LANES, 99.0)), CommandError, "^angle command of lane 0"),
    (lambda sims: sims.advance(0.1, command_angle=0.5, pulse_width=1.5e-3), InputError, "^command: got 'more"),
    (lambda sims: sims.advance(0.1, external_torque=np.inf), InputError, "^external_torque of lane 0"),
    (lambda sims: sims.advance(0.1, stream="main"), InputError, "^stream: got 'main'"),
    (lambda sims: sims.reset(output_angle=9.0, lanes=[3]), InputError, "^output_angle of lane 3"),
    (lambda sims: sims.reset(lanes=[LANES]), InputError, "^lanes: got"),
    (lambda sims: sims.set(load_inertia=-1.0), InputError, "^load_inertia of lane 0: got -1.0"),
    (lambda sims: sims.set(bus_voltage=-5.0), InputError, "^bus_voltage of lane 0: got -5.0"),
    (lambda sims: sims.set(torque_enable=True), InputError, "^torque_enable of PulseServo"),
    (lambda sims: sims.set(parameters={"load.torque": 0.1}), InputError, "^parameters on a GPU"),
    (lambda sims: sims["impulse"], UnknownNameError, "^unknown signal of PulseServo on a GPU 'impulse'"),
    (lambda sims: sims.impulse_work, InputError, "^impulse_work on a GPU"),
    (lambda sims: sims.restore(3), InputError, r"^restore\(memory\)")])
def test_mistakes_are_said_in_a_line_before_anything_moves(driver, call, error, words):
    _, there = both(driver)
    before = there.save()
    with pytest.raises(error, match=words) as caught:
        call(there)
    assert "\n" not in str(caught.value)
    assert np.array_equal(there.save().records, before.records)


def test_simulators_that_no_gpu_has(driver):
    model = st.PulseServo(st.load_servo(PLAIN))
    with pytest.raises(InputError, match=r"^watch_supply on a GPU"):
        st.VectorSimulator(model, 2, watch_supply=True, device="cuda")
    with pytest.raises(InputError, match=r"^device: got 'tpu'"):
        st.VectorSimulator(model, 2, device="tpu")
    with pytest.raises(InputError, match=r"^lanes one a thread: got 'a pendulum'"):
        st.VectorSimulator(model, 2, load=st.loads.Pendulum(mass=0.1, length=0.1), device="cuda")


WARMING = st.DigitalServo(st.load_servo(GOALS).replace(WARM))
VARIANTS = st.distributions.drawn_parameters(
    {"motor.torque_constant": "normal:5%", "friction.coulomb_torque_forward": "uniform:50%",
     "load.inertia": "uniform:5..40kg cm2", "load.torque": "uniform:-0.02..0.02Nm"},
    st.PulseServo(st.load_servo(PLAIN)), 300, 1)


@pytest.mark.parametrize("model", [None, pytest.param(st.DigitalServo(st.load_servo(GOALS)), marks=pytest.mark.slow),
                                   pytest.param(WARMING, marks=pytest.mark.slow)])
def test_a_reset_gives_a_lane_the_same_servo_there_and_here(shared, model):
    """Inertias and bus voltages that were imposed stay, and what was saved there continues here."""
    variants = {name: values for name, values in VARIANTS.items() if model is None or name.startswith("load.")}
    if model is WARMING:
        variants |= {"thermal.winding_capacity": np.linspace(0.3, 3.0, 300),
                     "thermal.ambient": np.linspace(270.0, 310.0, 300)}
    here, there = both(shared, model, variants=variants, load=None)
    rng, within, every = np.random.default_rng(2), 1e-11 if model is None else 1e-9, np.arange(LANES)
    seen = []
    for k in range(8):
        angles, some = rng.uniform(0.4, 1.1, LANES), rng.random(LANES) < 0.4
        here.advance(0.0137, command_angle=angles, external_torque=0.01)
        there.advance(0.0137, command_angle=angles if k % 2 else Guest(angles), external_torque=0.01)
        if k in (2, 4):
            here.reset(command_angle=angles[some], lanes=some)
            there.reset(command_angle=Guest(angles), lanes=Guest(some))
        if k == 3:
            volts = np.linspace(4.0, 7.0, LANES)
            here.set(load_inertia=2e-3, bus_voltage=volts[::2], lanes=every[::2])
            there.set(load_inertia=2e-3, bus_voltage=Guest(volts), lanes=Guest(every[::2].astype(np.int32)))
        if k == 4 and model is not None:
            here.set(torque_enable=False, lanes=some)
            there.set(torque_enable=Guest(~some), lanes=Guest(np.append(np.flatnonzero(some), [-1, LANES])))
        if k == 5:
            here.reset(output_angle=0.5)
            there.reset(output_angle=0.5)
        for each in (here, there) if k in (2, 5) else ():
            each.advance(0.01)  # under the torque of before, beside that of another load
        assert there.variant.read().tolist() == here.variant.tolist()
        seen.append(here.variant)
        same(here, there, within=within)
        if model is WARMING:
            assert there["winding_temperature"].read() == pytest.approx(here["winding_temperature"], abs=1e-7)
    assert len(np.unique(seen)) > LANES
    memory = there.save()
    assert np.array_equal(memory.numbers["motor"]["K"], here.save().numbers["motor"]["K"])
    here.restore(memory)
    for each in (here, there):
        each.advance(0.05)
    same(here, there, within=within)

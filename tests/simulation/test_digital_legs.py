"""Digital servos with random subsets of what real ones have: the same alone, among others, from C, and cut anyhow."""

import numpy as np
import pytest

import servotwin as st
from leg_draws import Drawn, drawn, goals, spread
from models.digital_servos import digital

pytestmark = pytest.mark.long

STEPS, EVERY, LANES = 6, 0.02, 9  # a goal every 20 ms
TICKS, INSIDE = [1e-3] * 20, [0.3e-3, 4.1e-3, 0.9e-3, 5.55e-3, EVERY - 10.85e-3]
SEEDS = [*range(24), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(24, 120))]
SEEN = ("output_angle", "output_speed", "motor_angle", "motor_speed", "duty", "trip", "goal_angle", "reference_angle",
        "armature_current", "bus_voltage", "load_torque")
SHAFT = ("output_angle", "output_speed", "duty", "trip")
ROUNDING, INTEGRATED = 2e-11, 1e-9  # of what is in closed form, and of what is not [rad], [rad/s] and so on


def near(result: st.Result) -> float:
    return ROUNDING if result.stats.method == "closed form" else INTEGRATED


def lanes_of(one: Drawn, lanes: np.ndarray, seed: int, threads: int = 1, **more: np.ndarray) -> st.VectorSimulator:
    """Return some of the lanes of a drawn servo, at rest."""
    parameters = {name: values[lanes] for name, values in spread(one.model, LANES, seed).items()} | more
    sims = st.VectorSimulator(one.model, len(lanes), load=one.load, parameters=parameters, threads=threads,
                              seed=seed + int(lanes[0]))
    sims.reset(command_angle=goals(one.model, seed, STEPS, LANES)[0, lanes], output_angle=0.0)
    return sims


def told(sims: st.VectorSimulator, one: Drawn, lanes: np.ndarray, seed: int, cuts: list[float], first: int = 0,
         last: int = STEPS) -> st.VectorSimulator:
    """Let lanes go on under their goals."""
    for command in goals(one.model, seed, STEPS, LANES)[first:last, lanes]:
        for duration in cuts:
            sims.advance(duration, command_angle=command)
    return sims


def same(a: st.VectorSimulator, b: st.VectorSimulator, which: np.ndarray | slice = slice(None)) -> None:
    """Check that lanes show the same, bit for bit."""
    for name in SEEN:
        np.testing.assert_array_equal(a[name][which], b[name], err_msg=name)
    np.testing.assert_array_equal(a.status[which], b.status)


ALL = np.arange(LANES)


# --- plain, lanes, C --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lane_is_the_servo_alone(seed):
    one, own = drawn(seed), goals(drawn(seed).model, seed, STEPS, LANES)[:, 0]
    command = st.signals.samples(np.arange(STEPS) * EVERY, own, unit="rad", hold="previous")
    times = np.sort(np.random.default_rng(seed).uniform(0.0, STEPS * EVERY, 60))
    asked = {"duration": STEPS * EVERY, "load": one.load, "output_times": times, "initial": {"output_angle": 0.0},
             "accuracy": 1e-12}
    alone = st.simulate(one.model, command, seed=seed, **asked).raise_if_failed()
    lanes = st.simulate_many(one.model, command, seeds=seed, outputs=SEEN, **asked).raise_if_failed()
    for name in SEEN:
        np.testing.assert_allclose(lanes[name][0], alone[name], rtol=near(alone), atol=near(alone), err_msg=name)
    supplied = abs(alone.energy.supply) + abs(alone.energy.load)
    assert abs(alone.energy.residual) <= 1e-9 * supplied + 1e-15


@pytest.mark.parametrize("seed", SEEDS)
def test_ticks_in_python_and_c_are_those_of_one_simulator(seed):
    """Goals, torques and torque switched off and on between calls that end at ticks."""
    one, rng = drawn(seed), np.random.default_rng(seed)
    own = goals(one.model, seed, STEPS, LANES)[:, 0]
    python, c = (st.VectorSimulator(one.model, 1, load=one.load, seed=seed, accuracy=1e-12) for _ in range(2))
    alone = st.Simulator(one.model, load=one.load, seed=seed, accuracy=1e-12)
    state = alone.initial(st.signals.constant(float(own[0]), unit="rad"), initial={"output_angle": 0.0})
    for sims in (python, c):
        sims.reset(command_angle=own[0], output_angle=0.0)
    entry, t, seen = c.c_entry(), 0.0, np.empty(1)
    for k, goal in enumerate(own):
        command = st.signals.constant(float(goal), unit="rad")
        for _ in range(3):
            duration, torque = 1e-3 * int(rng.integers(1, 13)), float(rng.uniform(-0.1, 0.1))
            t += duration
            if k in (3, 4):
                for sims in (python, c):
                    sims.set(torque_enable=k == 4)
                state = alone.changed(state, torque_enable=k == 4)
            python.advance(duration, command_angle=goal, external_torque=torque)
            entry.advance(entry.tick(duration, command_angle=np.array([goal]), external_torque=np.array([torque]),
                                     output_angle=seen))
            state = alone.advance(state, t, command, external_torque=torque)
            assert seen[0] == python["output_angle"][0]
            for name in SHAFT:
                expected = alone.observe(state, name, command, external_torque=torque)
                assert python[name][0] == pytest.approx(expected, rel=INTEGRATED, abs=INTEGRATED), (name, k)
    same(python, c)


# --- neighbours, chunks, threads, cuts --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lane_does_not_know_its_neighbours(seed):
    """Alone, among some, and among so many that several tiles and threads share them: bit for bit."""
    one = drawn(seed, without=("potentiometer",))  # whose noise has another seed at another place
    some = told(lanes_of(one, ALL, seed), one, ALL, seed, [EVERY])
    for lane in (0, 4, 8):
        alone = np.array([lane])
        same(some, told(lanes_of(one, alone, seed), one, alone, seed, [EVERY]), alone)
    many = np.random.default_rng(seed).integers(0, LANES, 190)
    same(some, told(lanes_of(one, many, seed, threads=2), one, many, seed, [EVERY]), many)


@pytest.mark.parametrize("seed", SEEDS)
def test_chunks_change_nothing(seed):
    one, at = drawn(seed), np.arange(STEPS) * EVERY
    commands = [st.signals.samples(at, own, unit="rad", hold="previous")
                for own in goals(one.model, seed, STEPS, LANES).T]
    batches = [st.simulate_many(one.model, commands, duration=STEPS * EVERY, load=one.load, chunk=chunk,
                                seeds=seed + ALL, parameters=spread(one.model, LANES, seed), output_step=1.7e-3,
                                outputs=SHAFT) for chunk in (None, 1, 4)]
    for name in SHAFT:
        np.testing.assert_array_equal(batches[0][name], batches[1][name])
        np.testing.assert_array_equal(batches[0][name], batches[2][name])


@pytest.mark.parametrize("seed", SEEDS)
def test_cuts_at_ticks_change_no_bit(seed):
    one = drawn(seed)
    same(told(lanes_of(one, ALL, seed), one, ALL, seed, [EVERY]), told(lanes_of(one, ALL, seed), one, ALL, seed, TICKS))


@pytest.mark.parametrize("seed", SEEDS)
def test_cuts_within_ticks_change_rounding_alone(seed):
    one = drawn(seed)
    whole = told(lanes_of(one, ALL, seed), one, ALL, seed, [EVERY])
    cut = told(lanes_of(one, ALL, seed), one, ALL, seed, INSIDE)
    for name in SHAFT:
        np.testing.assert_allclose(cut[name], whole[name], rtol=0.0, atol=INTEGRATED, err_msg=name)


# --- numbers that change ----------------------------------------------------------------------------------------------


def others(one: Drawn, seed: int) -> dict[str, np.ndarray]:
    """Return other numbers of all lanes; play does not get less, and does not come."""
    found, before = spread(one.model, LANES, seed + 1000), spread(one.model, LANES, seed)
    found |= {"firmware.proportional_gain": np.full(LANES, 9.0), "load.inertia": np.full(LANES, 4e-3),
              "friction.coulomb_torque_forward": np.full(LANES, 3e-4)}
    if "gear.backlash" in found:
        wider = np.maximum(found["gear.backlash"], before["gear.backlash"])
        found["gear.backlash"] = np.where(before["gear.backlash"] > 0.0, wider, 0.0)
    return found


@pytest.mark.parametrize("rest", [0.0, 0.4e-3], ids=["at a tick", "within one"])
@pytest.mark.parametrize("seed", SEEDS)
def test_changed_numbers_are_those_of_a_new_simulator(seed, rest):
    """One that is built with these numbers goes on from the same memory, bit for bit."""
    one = drawn(seed)
    changed = told(lanes_of(one, ALL, seed), one, ALL, seed, [EVERY], last=3)
    changed.advance(rest)
    new = lanes_of(one, ALL, seed, **others(one, seed))
    new.restore(changed.save())
    changed.set(parameters=others(one, seed))
    for sims in (changed, new):
        told(sims, one, ALL, seed, [EVERY], first=3)
    same(changed, new)


# --- known ------------------------------------------------------------------------------------------------------------


def test_a_slow_bridge_may_be_cut_within_ticks():
    """Its voltage is the same at any duty, so that a motion that a cut has kept seems to go on."""
    model = digital({"proportional_gain": 6.0, "off_state": "coast"})
    whole, cut = (st.VectorSimulator(model, 1, load=st.loads.Inertia(2e-3)) for _ in range(2))
    for sims, cuts in ((whole, [0.0203]), (cut, [0.0197, 0.0003, 0.0003])):
        sims.reset(command_angle=0.0, output_angle=0.0)
        for duration in cuts:
            sims.advance(duration, command_angle=0.3)
    np.testing.assert_allclose(cut["output_angle"], whole["output_angle"], rtol=0.0, atol=1e-9)

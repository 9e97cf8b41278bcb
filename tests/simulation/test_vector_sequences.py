"""Random sequences of what can be done with a `VectorSimulator`: numbers taken in place, and lanes by themselves."""

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.lanes.lane_numbers import LaneNumbers
from servotwin.simulation.lanes.store import Store
from simulation.test_retuned import HEAT, SERVOS

LANES, OPERATIONS = 5, 14
MORE = {
    "sprung": (st.PulseServo, "hitec-hs-755hb", {"gear.stiffness": 30.0, "gear.output_inertia": 1e-3}),
    "sprung program": (st.DigitalServo, "feetech-sts3215-12v", {"gear.stiffness": 30.0, "gear.output_inertia": 1e-3}),
    "warm, with play": (st.PulseServo, "geekservo-2kg", HEAT)}
KINDS = SERVOS | MORE
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")  # of what is drawn
SEEDS = (*range(12), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(12, 60)))
_GROUPS = ("motor.", "friction.", "electronics.", "supply.", "gear.backlash", "thermal.", "stops.restitution",
           "firmware.proportional_gain", "firmware.deadband_angle", "potentiometer.backlash")


def numbers_of(model):
    """Return the names of numbers that may change by a tenth."""
    return [name for name in (*model.requires, *model.optional) if name.startswith(_GROUPS)
            and isinstance(model.servo.get(name), float) and model.servo.get(name) != 0.0
            and not any(word in name for word in ("breakaway", "pulse_width", "_voltage_gain", "offset", "exponent"))]


def drawn(seed):
    """Return a model, what its lanes have at first, what is done with them, each a word and arguments, and options."""
    rng = np.random.default_rng((seed, 53))
    kind, name, changes = KINDS[list(KINDS)[seed % len(KINDS)]]
    model = kind(st.load_servo(name).replace(changes))
    names = numbers_of(model)

    def values(count):
        return {each: model.servo.get(each) * rng.uniform(0.92, 1.08, count)
                for each in rng.choice(names, 2, replace=False).tolist()}

    first = values(LANES) | {"load.inertia": rng.uniform(1e-4, 4e-4, LANES)}
    done = []
    for _ in range(OPERATIONS):
        which = np.flatnonzero(rng.random(LANES) < 0.5)
        which = which if len(which) else np.array([0])
        some, what = len(which), rng.integers(10)
        if what == 0:
            done.append(("set", {"lanes": which, "parameters": values(some)}))
        elif what == 1:
            done.append(("set", {"lanes": which, "parameters": {"load.inertia": rng.uniform(1e-4, 4e-4, some),
                                                                "load.torque": rng.uniform(-0.02, 0.02, some)}}))
        elif what == 2:
            done.append(("set", {"lanes": which, "load_inertia": rng.uniform(1e-4, 4e-4, some)}))
        elif what == 3:
            done.append(("set", {"lanes": which, "output_speed": rng.uniform(-1.0, 1.0, some)}))
        elif what == 4:
            done.append(("set", {"lanes": which, "bus_voltage": rng.uniform(4.5, 6.5, some)}))
        elif what == 5:
            done.append(("reset", {"lanes": which, "command_angle": rng.uniform(0.0, 0.6, some)}))
        else:
            done.append(("advance", {"duration": rng.choice([1e-3, 4e-3, 0.02, 0.013, 0.0371]),
                                     "command_angle": rng.uniform(0.0, 0.7, LANES)}))
    return model, first, done, {"watch_supply": seed % 7 == 3, "dtype": "float32" if seed % 5 == 4 else "float64"}


def ran(model, first, done, more, lanes=slice(None)):
    """Return all that shows of some lanes after each of these."""
    every = np.arange(LANES)[lanes]
    own = {name: value[every] for name, value in first.items()}
    sims = st.VectorSimulator(model, len(every), parameters=own, threads=1, seed=int(every[0]), **more)
    sims.reset(command_angle=0.1)
    place = np.full(LANES, -1)
    place[every] = np.arange(len(every))
    seen = []
    for word, asked in done:
        asked = dict(asked)
        if word == "advance":
            sims.advance(asked["duration"], command_angle=asked["command_angle"][every])
        else:
            here = place[asked["lanes"]] >= 0
            if not here.any():
                continue
            given = {name: value[here] for name, value in asked.items() if name not in ("lanes", "parameters")}
            if "parameters" in asked:
                given["parameters"] = {name: value[here] for name, value in asked["parameters"].items()}
            getattr(sims, word)(lanes=place[asked["lanes"]][here], **given)
        seen.append(np.array([sims[name] for name in sims.signals]))
    return seen


@pytest.mark.parametrize("seed", SEEDS)
def test_numbers_in_place_are_numbers_laid_out_anew(seed, monkeypatch):
    model, first, done, more = drawn(seed)
    within = 1e-8 if more["dtype"] == "float64" else 1e-4  # what float32 rounds where lanes are laid out anew
    quick = ran(model, first, done, more)
    monkeypatch.setattr(Store, "takes", lambda self, part, which, names: False)
    monkeypatch.setattr(LaneNumbers, "retuned", lambda self, which, parameters: False)
    for step, (now, then) in enumerate(zip(quick, ran(model, first, done, more), strict=True)):
        np.testing.assert_allclose(now, then, rtol=within, atol=within, err_msg=f"{step}: {done[step][0]}")


@pytest.mark.parametrize("seed", SEEDS[:12])
def test_a_lane_by_itself_is_the_lane_among_others(seed):
    model, first, done, more = drawn(seed)
    together, alone = ran(model, first, done, more), ran(model, first, done, more, slice(2, 3))
    those = [shown[:, 2:3] for shown, (word, asked) in zip(together, done, strict=True)
             if word == "advance" or 2 in asked["lanes"]]
    for step, (now, then) in enumerate(zip(alone, those, strict=True)):
        np.testing.assert_array_equal(now, then, err_msg=f"{step}")

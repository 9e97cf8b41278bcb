"""Servos of a bench are made of what is given of them: as the models make them, for all of the catalog."""

import os
import subprocess
import sys
import warnings

import numpy as np
import pytest

from bench_posts import post_of
from servotwin.errors import ServotwinError
from servotwin.models.engine.live import posts as making
from servotwin.models.engine.live import screen
from servotwin.models.engine.live.posts import Post
from servotwin.models.state.records import put_fields, record_of
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.parameters import catalog_names
from servotwin.web.live import Scene, SceneServo
from servotwin.web.live.actions import checked_command, command_signal
from servotwin.web.live.live_bench import load_of, models_of
from servotwin.web.live.scene import SERVO_MODELS

LOAD = {"inertia": 1e-4, "viscous_friction": 1e-3, "torque": 0.1, "coulomb_torque": 0.02, "mass": 0.1, "arm": 0.2,
        "hanging_angle": 0.3}


def numbers_in(record, path=""):
    """Return all numbers of a record by their dotted names."""
    for name in record.dtype.names:
        if record[name].dtype.names:
            yield from numbers_in(record[name], f"{path}{name}.")
        else:
            yield f"{path}{name}", record[name].item()


@pytest.mark.long
@pytest.mark.parametrize("kind", SERVO_MODELS)
def test_a_servo_is_what_its_model_makes_of_it(kind):
    looked = 0
    for name in catalog_names():
        scene = Scene(servos=(SceneServo(id=name, model=kind),), load=LOAD)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                model, = models_of(scene)
        except ServotwinError:
            continue
        posts, programs = np.zeros(2, record_of(Post)), np.zeros(2, record_of(Firmware))
        put_fields(posts[0], post_of(model, load_of(scene)))
        put_fields(programs[0], model.firmware() or NO_FIRMWARE)
        posts[1] = posts[0]
        how = making.make(posts[1], programs[1], making.FAMILIES[kind], model.given, making.Weights(*LOAD.values()))
        assert how == making.MADE
        for (ours, value), (_, theirs) in zip([*numbers_in(posts[1]), *numbers_in(programs[1])],
                                              [*numbers_in(posts[0]), *numbers_in(programs[0])], strict=True):
            assert value == pytest.approx(theirs, rel=1e-12, abs=1e-15, nan_ok=True), (name, ours)
        looked += 1
    assert looked > 0


def test_play_without_inertia_is_not_made():
    model, = models_of(Scene(servos=(SceneServo(id="hitec-hs-755hb", parameters={"gear.backlash": 0.01}),),
                             load={"inertia": 1e-4}))
    post, program = np.zeros(1, record_of(Post)), np.zeros(1, record_of(Firmware))
    nothing = making.Weights(*[0.0] * 7)
    assert making.make(post[0], program[0], making.PULSED, model.given, nothing) == making.NO_INERTIA
    assert not post[0].numbers.motor.K


@pytest.mark.parametrize("command", [
    {"shape": "hold", "value": 60}, {"shape": "step", "low": 10, "high": 20, "period": 0.5},
    {"shape": "step", "low": 10, "high": 20, "period": 0}, {"shape": "sine", "mean": 5, "amplitude": 3, "frequency": 2},
    {"shape": "sweep", "mean": 5, "amplitude": 3, "start_frequency": 0.5, "end_frequency": 4, "duration": 0.7},
    {"shape": "staircase", "low": 10, "high": 40, "steps": 3, "dwell": 0.1},
    {"shape": "recorded", "time": [1.0, 1.5, 2.5], "value": [1.0, 1.0, 3.0], "hold": "previous"},
    {"shape": "recorded", "time": [1.0, 1.5, 2.5], "value": [1.0, 1.5, 3.0], "hold": "linear"}])
def test_shapes_are_the_signals_of_the_package(command):
    known = checked_command({"unit": "V", **command})
    signal = command_signal(known, 0.0)
    names = screen.FIELDS[known["shape"]]
    single = [known[name] for name in names if not isinstance(known[name], list)]
    given = np.array([float(one == "linear") if isinstance(one, str) else one for one in single])
    samples = [np.array(known.get(name, ()), float) for name in ("time", "value")]
    if known["shape"] != "recorded":
        samples = [np.empty(0), np.empty(0)]
    table = np.zeros((2 * screen.PERIODS + 1, 7))
    count = screen.shaped([*screen.FIELDS].index(known["shape"]), given, *samples, table)
    np.testing.assert_allclose(table[:count], signal.pieces.rows, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(screen.extremes(table, count)[:2], signal.pieces.extremes, rtol=1e-12)


@pytest.mark.long
def test_what_a_page_knows_has_one_order():
    """Of sets it has another in each process: `web --export` wrote two pages by chance."""
    program = ("import json; from servotwin.web.alone.pack import _servo; "
               "print(json.dumps(_servo('dynamixel-2xl430-w250')))")
    told = {subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True,
                           env={**os.environ, "PYTHONHASHSEED": seed}).stdout for seed in ("0", "1", "2", "3", "4")}
    assert len(told) == 1

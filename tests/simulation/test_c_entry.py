"""The entry for C: bit for bit what Python does on the same lanes, from compiled code, from C and from threads."""

import ctypes
import shutil
import subprocess
import threading

import numpy as np
import pytest

import servotwin as st
from conftest import EVERYTHING
from models.digital_servos import COUNT, digital
from servotwin.errors import InputError
from servotwin.simulation.compile.layout import MESSAGES, SHOWN, TICK, VERSION
from vector_cases import CASES, model_of

LANES = 4
COMMANDS = {"pulse_width": (1.0e-3, 2.0e-3), "command_angle": (1.2, 1.9), "command_voltage": (1.0, 2.0)}
IMPOSED = ("output_angle", "output_speed", "load_inertia", "bus_voltage")


def random_tick(rng, kinds):
    """Return what one tick gives, each input or not: of the command and torque, and of what is imposed."""
    kind = rng.choice([*kinds, "none"])
    given = {} if kind == "none" else {kind: rng.uniform(*COMMANDS[kind], LANES)}
    if rng.random() < 0.4:
        given["external_torque"] = rng.uniform(-0.1, 0.1, LANES)
    imposed = {"output_angle": rng.uniform(1.2, 1.9, LANES), "output_speed": rng.uniform(-3.0, 3.0, LANES),
               "load_inertia": rng.uniform(5e-4, 4e-3, LANES), "bus_voltage": rng.choice([0.1, 5.0, 5.7, 7.0], LANES)}
    return given, {name: values for name, values in imposed.items() if rng.random() < 0.25}


def in_python(sims, duration, given, imposed):
    if imposed:
        sims.set(**imposed)
    sims.advance(duration, **given)


def in_c(sims, duration, given, imposed):
    """Advance from C; return what it shows."""
    entry = sims.c_entry()
    shown = {name: np.empty(LANES) for name in SHOWN}
    status = np.empty(LANES, np.int8)
    entry.advance(entry.tick(duration, **given, **{f"set_{name}": values for name, values in imposed.items()},
                             **shown, status=status))
    return {**shown, "status": status}


def same(a, b):
    """Check that lanes remember the same in two simulators, bit for bit."""
    one, other = a.save(), b.save()
    for name in ("command", "torque", "status", "ended", "work"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.records.tobytes() == other.records.tobytes()


@pytest.mark.long(but="stops-BoundedServo-float64")
@pytest.mark.parametrize(("kind", "dtype"), [
    (st.PulseServo, "float64"), pytest.param(st.PulseServo, "float32", marks=pytest.mark.slow),
    (st.PulseServoInductive, "float64"), (st.BoundedServo, "float64")])
@pytest.mark.parametrize("name", CASES)
def test_it_is_python_bit_for_bit(servo, name, kind, dtype):
    """Ticks of random lengths, each input given or not, in Python alone and in Python and C by turns."""
    changes, load = CASES[name]
    model, rng = model_of(servo, changes, kind), np.random.default_rng(7)
    several = {"motor.armature_resistance": [2.8, 3.1, 3.4, 3.7]}
    python, both = (st.VectorSimulator(model, LANES, load=load, parameters=several, dtype=dtype, seed=3)
                    for _ in range(2))
    for sims in (python, both):
        sims.reset(output_angle=1.5)
    for k in range(40):
        duration, (given, imposed) = rng.choice([0.0, 1e-3, 7e-3, 0.031]), random_tick(rng, COMMANDS)
        in_python(python, duration, given, imposed)
        if k % 4 == 3:
            in_python(both, duration, given, imposed)
        else:
            shown = in_c(both, duration, given, imposed)
            np.testing.assert_array_equal(shown.pop("status"), python.status)
            for signal, values in shown.items():
                expected = python[signal] if signal in model.available else np.full(LANES, np.nan)
                np.testing.assert_array_equal(values, expected, err_msg=f"{signal}, tick {k}")
        same(python, both)
    assert np.ptp(python["output_angle"]) > 0.0


@pytest.mark.long
def test_programs_are_python_bit_for_bit():
    """Digital servos by the same ticks: their lanes go from tick to tick together, or in the middle of one alone."""
    model = digital({"proportional_gain": 6.0, "derivative_gain": 0.02, "angle_quantum": COUNT, "overload_duty": 0.5,
                     "overload_time": 0.02, "overload_output": 0.2})
    several = {"firmware.proportional_gain": [3.0, 6.0, 9.0, 12.0],
               "firmware.control_period": [1e-3, 1e-3, 1.5e-3, 2e-3]}
    rng = np.random.default_rng(8)
    python, c = (st.VectorSimulator(model, LANES, parameters=several, seed=3) for _ in range(2))
    for sims in (python, c):
        sims.reset(command_angle=0.1)
    for k in range(30):
        duration, (given, imposed) = rng.choice([1e-3, 7e-3, 0.0305]), random_tick(rng, ["command_angle"])
        in_python(python, duration, given, imposed)
        shown = in_c(c, duration, given, imposed)
        np.testing.assert_array_equal(shown["output_angle"], python["output_angle"], err_msg=f"tick {k}")
    same(python, c)
    assert np.ptp(python["output_angle"]) > 0.0


@pytest.mark.long
def test_lanes_of_several_ways_side_by_side(servo):
    """Some run side by side, some one by one, one fails; parameters and a reset in Python come between."""
    parameters = {"load.spring.stiffness": [0.0, 0.1, 1e18, 0.0],
                  "electronics.off_state": ["brake", "brake", "brake", "coast"],
                  "stops.upper_angle": [1.7, 2.0, 2.0, 2.0]}
    python, both = (st.VectorSimulator(st.PulseServo(servo), LANES, load=st.loads.Spring(0.1), parameters=parameters)
                    for _ in range(2))
    rng = np.random.default_rng(1)
    for sims in (python, both):
        sims.reset(output_angle=[1.6, 1.5, 1.5, 1.5])
    for k in range(60):
        given = {"pulse_width": rng.uniform(1.6e-3, 1.9e-3, LANES)}
        in_python(python, 9e-3, given, {})
        shown = in_c(both, 9e-3, given, {})
        np.testing.assert_array_equal(shown["output_angle"], python["output_angle"])
        np.testing.assert_array_equal(shown["load_torque"], python["load_torque"])
        same(python, both)
        if k == 20:
            for sims in (python, both):
                sims.set(parameters={"load.spring.stiffness": [0.0, 0.0]}, lanes=[1, 2])
        if k == 40:
            assert np.isnan(shown["output_angle"][2])
            assert shown["status"].tolist() == [0, 0, st.Status.TOO_FAST.code, 0]
            for sims in (python, both):
                sims.reset(lanes=[2])
    assert not python.status.any()


def test_what_python_has_saved_goes_on_in_c(servo):
    model = st.PulseServo(servo)
    sims, other = (st.VectorSimulator(model, LANES) for _ in range(2))
    widths = np.linspace(1.2e-3, 1.8e-3, LANES)
    in_c(sims, 0.01, {"pulse_width": widths}, {})
    memory = sims.save()
    in_c(sims, 0.05, {}, {})
    other.c_entry()
    other.restore(memory)
    in_c(other, 0.05, {}, {})
    same(sims, other)


def test_what_was_seen_does_not_outlive_a_tick(servo):
    sims = st.VectorSimulator(st.PulseServo(servo), LANES)
    before = sims["armature_current"]
    shown = in_c(sims, 0.013, {"pulse_width": np.full(LANES, 1.9e-3)}, {})
    np.testing.assert_array_equal(sims["armature_current"], shown["armature_current"])
    assert (sims["armature_current"] != before).all()


# --- what it refuses --------------------------------------------------------------------------------------------------


BAD = {  # members of the struct, and the code that they lead to
    "nan": ({"pulse_width": np.nan}, 5),
    "infinite torque": ({"external_torque": np.inf}, 5),
    "nan for a speed": ({"set_output_speed": np.nan}, 5),
    "a pulse of no width": ({"pulse_width": 0.0}, 6),
    "a pulse longer than a frame": ({"pulse_width": 0.03}, 6),
    "an angle that asks for too much": ({"command_angle": 2.1}, 6),
    "two commands": ({"command_angle": 1.5, "pulse_width": 1.5e-3}, 6),
    "beyond a stop": ({"set_output_angle": 2.1}, 7),
    "a negative inertia": ({"set_load_inertia": -1e-9}, 8),
    "no voltage": ({"set_bus_voltage": 0.0}, 9),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_numbers_change_nothing(servo, name):
    """The second lane is at fault, and what is good beside it does not count either."""
    members, code = BAD[name]
    sims = st.VectorSimulator(model_of(servo, {"stops.upper_angle": 2.0}), LANES)
    sims.advance(0.013, pulse_width=1.7e-3)
    before, current = sims.save(), sims["armature_current"]
    arrays = {member: np.full(LANES, {"command_angle": 1.5, "set_output_angle": 1.5, "pulse_width": 1.5e-3}.get(
        member, 1.0)) for member in members}
    for member, value in members.items():
        arrays[member][1] = value
    good = {"external_torque": np.full(LANES, 0.1), "set_load_inertia": np.full(LANES, 1e-3)}
    entry, out = sims.c_entry(), np.full(LANES, 7.0)
    with pytest.raises(InputError, match=f"servotwin_advance returned {code}: {MESSAGES[code]}") as error:
        entry.advance(entry.tick(0.01, **{**good, **arrays}, output_angle=out))
    assert "\n" not in str(error.value)
    assert (out == 7.0).all()
    after = sims.save()
    assert after.records.tobytes() == before.records.tobytes()
    for part in ("command", "torque", "numbers"):
        np.testing.assert_array_equal(getattr(after, part), getattr(before, part))
    np.testing.assert_array_equal(sims["armature_current"], current)


@pytest.mark.parametrize("duration", [-1e-3, np.nan, np.inf, 2e5])
def test_bad_durations(servo, duration):
    sims = st.VectorSimulator(st.PulseServo(servo), LANES)
    entry = sims.c_entry()
    with pytest.raises(InputError, match="returned 4"):
        entry.advance(entry.tick(duration))
    assert (sims.time == 0.0).all()


def test_commands_at_the_very_edge_are_taken_as_python_takes_them(servo):
    """Bounds of commands are per lane, and the same in both."""
    stops = {"stops.lower_angle": 0.2, "stops.upper_angle": 2.0}
    free = dict.fromkeys(stops)
    models = (model_of(servo, stops), model_of(servo, stops, st.BoundedServo), model_of(servo, free))
    table = {"command_angle": (0.2 - 2e-9, 0.2 - 1e-10, 0.2, 2.0, 2.0 + 1e-10, 2.0 + 2e-9, 1e3),
             "pulse_width": (0.0, 1e-9, 2.9e-4, 3.1e-4, 2.6e-3, 2.8e-3, 0.0199, 0.02),
             "command_voltage": (-50.0, 1.0, 99.0)}
    answers = set()
    for model in models:
        sims = st.VectorSimulator(model, LANES)
        entry = sims.c_entry()
        for name, values in table.items():
            for value in values:
                try:
                    sims.advance(0.0, **{name: value})
                    good = True
                except InputError:
                    good = False
                tick = entry.tick(0.0, **{name: np.full(LANES, value)})
                code = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(entry.address)(ctypes.addressof(tick))
                assert code == (0 if good else 6), (model, name, value)
                assert not good or value < 1e3  # an angle that no pulse within a frame stands for
                answers.add(code)
    assert answers == {0, 6}


def test_another_version_is_refused_and_nothing_touched(servo):
    sims = st.VectorSimulator(st.PulseServo(servo), LANES)
    entry = sims.c_entry()
    out = np.full(LANES, 7.0)
    for member, value, code in (("version", VERSION + 1, 2), ("lanes", LANES + 1, 3), ("simulator", None, 1)):
        tick = entry.tick(0.01, output_angle=out)
        setattr(tick, member, value)
        before = bytes(tick)
        with pytest.raises(InputError, match=f"returned {code}"):
            entry.advance(tick)
        assert bytes(tick) == before
    assert ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(entry.address)(None) == 1
    assert (sims.time == 0.0).all()
    assert (out == 7.0).all()


def test_a_record_that_ends(servo):
    sims = st.VectorSimulator(st.PulseServo(servo), LANES, load=st.loads.Recorded([0.0, 0.05], [0.0, 0.1]))
    entry = sims.c_entry()
    for _ in range(5):
        entry.advance(entry.tick(0.01))
    with pytest.raises(InputError, match="returned 10"):
        entry.advance(entry.tick(0.01))
    np.testing.assert_allclose(sims.time, 0.05)


READ_ONLY = np.zeros(LANES)
READ_ONLY.flags.writeable = False
BAD_ARRAYS = {
    "unknown": {"output_torque": np.zeros(LANES)}, "too few": {"pulse_width": np.zeros(LANES - 1)},
    "single": {"pulse_width": np.zeros(LANES, np.float32)}, "a list": {"pulse_width": [1.5e-3] * LANES},
    "every other": {"pulse_width": np.zeros(2 * LANES)[::2]}, "status of floats": {"status": np.zeros(LANES)},
    "masked": {"pulse_width": np.ma.zeros(LANES)}, "not to be written": {"output_angle": READ_ONLY},
    "no time": {"duration": "a second"},
}


@pytest.mark.parametrize("name", BAD_ARRAYS)
def test_bad_arrays_are_one_clear_line(servo, name):
    entry = st.VectorSimulator(st.PulseServo(servo), LANES).c_entry()
    with pytest.raises(InputError, match=f"tick\\({next(iter(BAD_ARRAYS[name]))}\\)") as error:
        entry.tick(**BAD_ARRAYS[name])
    assert "\n" not in str(error.value)
    entry.tick(pulse_width=READ_ONLY)  # what is only read need not be writeable


# --- who calls --------------------------------------------------------------------------------------------------------


PROGRAM = """
#include <stddef.h>
#include "servotwin.h"

size_t members(size_t *at) {
    %s
    return sizeof(servotwin_tick);
}

int run(servotwin_advance advance, void *simulator, int64_t lanes, int64_t ticks, const double *width, double *angle,
        int8_t *status) {
    servotwin_tick tick = {.version = SERVOTWIN_VERSION, .lanes = lanes, .duration = 1e-3, .simulator = simulator,
                           .pulse_width = width, .output_angle = angle, .status = status};
    for (int64_t k = 0; k < ticks; k++) {
        int code = advance(&tick);
        if (code != SERVOTWIN_DONE)
            return code;
        tick.pulse_width = NULL;  /* it stays */
    }
    return SERVOTWIN_DONE;
}
"""


@pytest.fixture(scope="module")
def program(servo, tmp_path_factory):
    """A program in C that includes the header, as a shared library."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: cc is not found")
    folder = tmp_path_factory.mktemp("program")
    st.VectorSimulator(st.PulseServo(servo), 1).c_entry().write_header(folder)
    offsets = "\n    ".join(f"at[{k}] = offsetof(servotwin_tick, {name});" for k, name in enumerate(TICK))
    (folder / "program.c").write_text(PROGRAM % offsets)
    subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-shared", "-fPIC",
                    "program.c", "-o", "program.so"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "program.so"))


def test_a_program_in_c(servo, program):
    sims, python = (st.VectorSimulator(st.PulseServo(servo), LANES) for _ in range(2))
    entry, widths = sims.c_entry(), np.linspace(1.2e-3, 1.8e-3, LANES)
    angle, status = np.empty(LANES), np.full(LANES, 7, np.int8)
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (widths, angle, status)]
    numbers = [*map(ctypes.c_void_p, (entry.address, entry.simulator)), *map(ctypes.c_int64, (LANES, 500))]
    assert program.run(*numbers, *pointers) == 0
    for _ in range(500):
        python.advance(1e-3, pulse_width=widths)
    same(sims, python)
    np.testing.assert_array_equal(angle, python["output_angle"])
    assert status.tolist() == [0] * LANES
    widths[2] = np.nan
    assert program.run(*numbers, *pointers) == 5


def test_the_header_says_what_python_says(servo, program):
    """Members stand where Python writes them, and codes and version mean the same."""
    entry = st.VectorSimulator(st.PulseServo(servo), 1).c_entry()
    places = (ctypes.c_size_t * len(TICK))()
    program.members.restype = ctypes.c_size_t
    assert program.members(places) == ctypes.sizeof(type(entry.tick()))
    assert list(places) == [getattr(type(entry.tick()), name).offset for name in TICK]
    assert f"#define SERVOTWIN_VERSION {VERSION}" in entry.header
    for code in MESSAGES:
        assert f" = {code}," in entry.header or f" = {code} " in entry.header


@pytest.mark.long
def test_two_threads_with_two_simulators(servo):
    """Nothing is shared: each goes as it would alone, though both are in compiled code at once."""
    models = (st.PulseServo(servo), model_of(servo, EVERYTHING))
    together, alone = ([st.VectorSimulator(model, LANES) for model in models] for _ in range(2))
    widths = np.linspace(1.2e-3, 1.8e-3, LANES)

    def run(sims, go):
        go.wait()
        for _ in range(300):
            in_c(sims, 1e-3, {"pulse_width": widths}, {})

    go = threading.Barrier(2)
    threads = [threading.Thread(target=run, args=(sims, go)) for sims in together]
    for sims in together:
        sims.c_entry()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for one, other in zip(together, alone, strict=True):
        for _ in range(300):
            other.advance(1e-3, pulse_width=widths)
        same(one, other)


def test_the_entry_keeps_the_simulator(servo):
    entry = st.VectorSimulator(st.PulseServo(servo), LANES).c_entry()
    angle = np.empty(LANES)
    entry.advance(entry.tick(0.02, output_angle=angle))
    assert np.isfinite(angle).all()


def test_a_header_that_cannot_be_written(servo, tmp_path):
    entry = st.VectorSimulator(st.PulseServo(servo), LANES).c_entry()
    assert entry.write_header(tmp_path).read_text() == entry.header
    with pytest.raises(InputError, match=r"write_header\(folder\)"):
        entry.write_header(tmp_path / "missing")


@pytest.mark.long(but="PulseServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.DigitalServo])
def test_buses_are_those_of_python(servo, kind):
    """Two lanes on one supply, one on another and one alone: in Python alone, and in Python and C by turns."""
    battery = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4)
    model = kind(servo if kind is st.PulseServo else st.load_servo("feetech-sts3215-12v"))
    rng, command = np.random.default_rng(3), "pulse_width" if kind is st.PulseServo else "command_angle"
    low, high = (1.2e-3, 1.8e-3) if kind is st.PulseServo else (0.5, 1.0)
    python, both = (st.VectorSimulator(model, LANES, load=st.loads.Inertia(1e-3), threads=1, bus=[
        (battery, [0, 2]), (battery, [1])]) for _ in range(2))
    lowest = np.inf
    for k in range(60):
        given = {command: rng.uniform(low, high, LANES), "external_torque": rng.uniform(-0.05, 0.05, LANES)}
        imposed = {"output_speed": rng.uniform(-1.0, 1.0, LANES), "load_inertia": rng.uniform(5e-4, 4e-3, LANES)}
        imposed = imposed if k % 7 == 0 else {}
        in_python(python, 3e-3, given, imposed)
        if k % 4 == 3:
            in_python(both, 3e-3, given, imposed)
        else:
            shown = in_c(both, 3e-3, given, imposed)
            np.testing.assert_array_equal(shown.pop("status"), python.status)
            for signal, values in shown.items():
                np.testing.assert_array_equal(values, python[signal], err_msg=f"{signal} at tick {k}")
        same(python, both)
        lowest = min(lowest, python["bus_voltage"][0])
    assert lowest < 5.9

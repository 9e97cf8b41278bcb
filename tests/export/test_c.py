"""A servo as C does what it does in Python: states, signals, events, and what it refuses."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import servotwin as st
from export.c_servo import STRICT, CServo, Events
from export.structures import HEAT, INDUCTANCE, STRUCTURES, commands, model_of
from servotwin import export
from servotwin.errors import InputError, OutputError, OutputExistsError
from servotwin.export.c_code import table_for
from servotwin.models.engine.events.crossings import NAMES
from servotwin.models.terms.given import given_of

COMPILERS = [compiler for compiler in ("gcc", "clang") if shutil.which(compiler)]
pytestmark = pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
FEW = ("plain", "bounded", "on a bus")  # of which one has no pulses, and one a program
CALLS, DRAWS = 60, 26  # 26 for each of 23 structures: 598 servos
SPANS = (1e-3, 2.5e-3, 7.1e-3, 0.02, 0.0)  # s
SERVO = "hitec-hs-755hb"
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Return a function that returns a structure as C, compiled once."""
    known = {}

    def of(name):
        if name not in known:
            own = STRUCTURES[name]
            known[name] = CServo(export.c(model_of(name, 0), own.load, name="servo"),
                                 tmp_path_factory.mktemp("c"), COMPILERS[0], ("-O1",))
        return known[name]

    return of


def apart(name, draw, c):
    """Return how far C is off Python: the angle [rad], and the worst signal relative to its size."""
    own, model = STRUCTURES[name], model_of(name, draw)
    rng = np.random.default_rng([8, draw, *name.encode()])
    c.like(table_for(model, own.load))
    sim, (told, unit) = st.Simulator(model, own.load, seed=3), commands(model, rng)
    state = sim.initial(st.signals.constant(told, unit=unit))
    assert c.start(told, seed=3) == 0
    angle = signal = 0.0
    for k in range(CALLS):
        if k % 20 == 0:
            told, torque = commands(model, rng)[0], float(rng.uniform(-0.05, 0.05))
            command = st.signals.constant(told, unit=unit)
        until = state.time + float(rng.choice(SPANS))
        state = sim.advance(state, until, command, external_torque=torque)
        assert c.advance(until, told, torque) == 0
        seen = c.observe(told, torque)
        angle = max(angle, abs(seen["output_angle"] - state["output_angle"]))
        if k % 10 == 3:
            for signal_name, found in seen.items():
                exact = sim.observe(state, signal_name, command, external_torque=torque)
                assert np.isnan(found) == np.isnan(exact), signal_name
                signal = max(signal, np.nan_to_num(abs(found - exact) / max(1.0, abs(exact))))
    assert c.time == pytest.approx(state.time, rel=1e-15)
    return angle, signal


@pytest.mark.long
@pytest.mark.parametrize("name", FEW)
def test_c_is_python(name, compiled):
    for draw in range(3):
        angle, signal = apart(name, draw, compiled(name))
        assert angle <= STRUCTURES[name].off
        assert signal <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", STRUCTURES)
def test_c_is_python_for_random_servos_of_all_structures(name, compiled):
    for draw in range(DRAWS):
        angle, signal = apart(name, draw, compiled(name))
        assert angle <= STRUCTURES[name].off, draw
        assert signal <= 1e3 * STRUCTURES[name].off, draw


@pytest.mark.long
def test_names_of_signals_are_those_of_the_model(compiled):
    for name in FEW:
        available = [signal for signal in model_of(name, 0).available
                     if signal not in ("command_voltage", "command_angle", "pulse_width")]
        assert compiled(name).names == available


@pytest.mark.long
def test_events_are_those_of_a_result(compiled):
    for name in FEW:
        c, model = compiled(name), model_of(name, 0)
        c.like(table_for(model, STRUCTURES[name].load))
        before, after = c.command(0.5), c.command(1.2)
        unit = "rad" if name == "on a bus" else "s"
        result = st.simulate(model, st.signals.step(before, after, at=0.0, unit=unit), duration=0.4,
                             load=STRUCTURES[name].load)
        c.start(before)
        events = Events()
        assert c.advance(0.4, after, events=events) == 0
        found = [(NAMES[row["kind"]], row["time"], row["angle"]) for row in events.rows[:events.count]]
        assert [kind for kind, *_ in found] == [event.kind for event in result.events]
        assert {c.events[int(row["kind"])].replace("_", " ").lower() for row in events.rows[:events.count]} == {
            event.kind for event in result.events}
        for (_, time, angle), event in zip(found, result.events, strict=True):
            assert (time, angle) == pytest.approx((event.time, event.value), abs=1e-9)


@pytest.mark.slow
def test_goals_after_a_silence_are_followed(tmp_path):
    """As in lanes: a servo that was limp for want of a goal is so no more."""
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({
        "firmware.signal_timeout": 0.15, "firmware.signal_loss": "limp", "firmware.bus_latency": 7e-4}))
    c = CServo(export.c(model, st.loads.Load(torque=0.8), name="servo"), tmp_path, COMPILERS[0], ("-O1",))
    lanes = st.VectorSimulator(model, 1, load=st.loads.Load(torque=0.8))
    lanes.reset(command_angle=0.1)
    c.start(c.command(0.1))
    for k in range(80):
        goal = 0.1 if k < 30 else 0.4
        lanes.advance(0.02, command_angle=goal)
        assert c.advance(0.02 * (k + 1), c.command(goal)) == 0
        assert c.observe(c.command(goal))["output_angle"] == pytest.approx(
            lanes["output_angle"][0], abs=1e-11)


def test_events_beyond_the_room_are_counted(compiled):
    c = compiled("plain")
    counts = []
    for room in (0, 3, 1000):
        events = Events(room)
        c.start(c.command(0.5))
        assert c.advance(0.4, c.command(1.2), events=events) == 0
        counts.append(events.count)
    assert counts[1] == counts[2] > 3
    assert counts[0] == 0  # without room nothing is looked for


def test_a_command_for_an_angle_is_that_of_python(compiled):
    for name in FEW:
        model, c = model_of(name, 0), compiled(name)
        c.like(table_for(model, STRUCTURES[name].load))
        c.start(c.command(1.0))
        assert c.observe(c.command(1.0))["output_angle"] == pytest.approx(1.0, abs=1e-12)


def test_what_is_not_possible_changes_nothing(compiled):
    nan, inf = float("nan"), float("inf")
    for name, bad in (("plain", (0.0, -1e-3, 0.02, 1.0)), ("bounded", (1e-4, 3e-3)), ("on a bus", (-10.0, 10.0))):
        c = compiled(name)
        good = c.command(1.0)
        c.start(good)
        c.advance(0.0123, good)
        before = c.state.copy()
        for command in (*bad, nan, inf, -inf):
            assert c.advance(0.02, command) == -2
            assert c.start(command) == -2
            assert c.observe(command) == -2
        for until in (nan, inf, -inf):
            assert c.advance(until, good) == -1
        for torque in (nan, inf, -inf):
            assert c.advance(0.02, good, torque) == -1
            assert c.observe(good, torque) == -1
        assert c.advance(0.0122, good) == -3
        np.testing.assert_array_equal(c.state, before)
        assert c.advance(0.02, good) == 0


def test_a_run_that_cannot_go_on_leaves_the_state(compiled):
    c = compiled("plain")
    c.start(c.command(1.0))
    before = c.state.copy()
    assert c.advance(0.1, c.command(1.0), 1e308) == 1
    np.testing.assert_array_equal(c.state, before)


def test_a_copied_state_goes_on_alike(compiled):
    for name in FEW:
        c = compiled(name)
        c.start(c.command(0.5), seed=5)
        c.advance(0.033, c.command(1.0))
        kept, seen = c.state.copy(), []
        for _ in range(2):
            c.state[:] = kept
            c.advance(0.1, c.command(1.0))
            seen.append(c.observe(c.command(1.0)))
        np.testing.assert_equal(seen[0], seen[1])


@pytest.mark.long
def test_what_a_servo_lacks_is_not_in_its_code():
    plain, warm = (export.c(model_of(name, 0)) for name in ("plain", "warm"))
    assert "heat" in plain.left_out
    assert "heat" not in warm.left_out
    assert "winding_temperature" not in plain.header.split("/* Signals (SI)")[1]
    for text in ("controller", "dormand_prince", "stribeck", "warm_linear", "two_mass", "malloc"):
        assert text not in plain.source
    body = re.sub(r"\{[^{}]*\}", "", re.sub(r"/\*.*?\*/", "", warm.source, flags=re.DOTALL))
    while (shorter := re.sub(r"\{[^{}]*\}", "", body)) != body:
        body = shorter
    lines = [line for line in body.splitlines() if re.match(r"(static )?(?!const|inline|typedef)\w.*(=|\w;)", line)]
    assert not [line for line in lines if "(" not in line and "const" not in line and "typedef" not in line]


LACKS = {  # what asks for what the code of a structure leaves out
    "plain": (INDUCTANCE, HEAT, {"gear.backlash": 0.02, "gear.output_inertia": 1e-4},
              {"electronics.off_state": "coast"}, {"friction.load_friction": 0.1}),
    "bounded": (INDUCTANCE,), "on a bus": (INDUCTANCE, HEAT)}


@pytest.mark.long
@pytest.mark.parametrize("name", FEW)
def test_c_makes_the_numbers_that_python_makes(name, tmp_path):
    load = st.loads.Inertia(2e-3) + st.loads.Coulomb(0.02) + st.loads.Constant(0.01)
    c = CServo(export.c(model_of(name, 0), load, name="servo", parameters=True), tmp_path, COMPILERS[0], ("-O0",))
    for draw in range(5):
        assert c.make(model_of(name, draw).given) == 0
        assert c.numbers == list(table_for(model_of(name, draw), load))
    before, own = c.numbers, STRUCTURES[name]
    for changes in LACKS[name]:
        given = given_of(st.load_servo(own.servo).replace(own.changes | changes),
                         (*own.kind.requires, *own.kind.optional, *changes))
        assert c.make(given) == -4
        assert c.numbers == before


@pytest.mark.long
def test_all_names_of_the_header_begin_with_that_of_the_servo():
    for name in ("on a bus", "everything"):
        header = export.c(model_of(name, 0), name="servo", parameters=True).header
        types = re.findall(r"^\} (\w+);", header, re.MULTILINE)
        assert len(types) == len(set(types)) > 20
        assert all(each.startswith("servo_") for each in types)


@pytest.mark.long
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", FEW)
def test_no_compiler_complains(compiler, name, tmp_path):
    code = export.c(model_of(name, 0), STRUCTURES[name].load, name="servo")
    code.write(tmp_path)
    subprocess.run([compiler, *STRICT, "-O1", "-Wmissing-prototypes", "-c", "-o", str(tmp_path / "servo.o"),
                    str(tmp_path / "servo.c")], check=True)


@pytest.mark.slow
def test_no_compiler_complains_of_any_structure(tmp_path):
    for name, own in STRUCTURES.items():
        export.c(model_of(name, 0), own.load, name="servo", parameters=True).write(tmp_path, overwrite=True)
        for compiler in COMPILERS:
            subprocess.run([compiler, *STRICT, "-fsyntax-only", str(tmp_path / "servo.c")], check=True)


@pytest.mark.long
def test_the_header_is_one_for_cpp_too(tmp_path):
    if shutil.which("g++") is None:
        pytest.skip("needs g++")
    export.c(model_of("on a bus", 0), name="servo").write(tmp_path)
    (tmp_path / "main.cpp").write_text('#include "servo.h"\nint main() { servo_state s; (void)s; return 0; }\n')
    subprocess.run(["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-c", "-o",
                    str(tmp_path / "main.o"), str(tmp_path / "main.cpp")], check=True)


@pytest.mark.long
def test_the_program_of_the_guide_prints_what_the_page_says(tmp_path):
    page = (ROOT / "docs" / "guide" / "export.md").read_text(encoding="utf-8")
    program, told = (re.search(rf"```{kind}\n(.*?)```", page, re.DOTALL)[1] for kind in ("c", "text"))
    export.c(st.PulseServo(st.load_servo(SERVO)), st.loads.Inertia(1e-3)).write(tmp_path)
    (tmp_path / "main.c").write_text(program)
    words = told.splitlines()[0].removeprefix("$ ").split(" && ")[0].split()
    subprocess.run([COMPILERS[0], *words[1:]], cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "servo")], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == told.splitlines()[1:]


# --- what is refused ----------------------------------------------------------------------------------------------


def test_what_has_no_c_is_refused_in_a_line(tmp_path):
    servo = st.load_servo(SERVO)
    model = st.PulseServo(servo)
    motor = servo.replace({"motor.armature_inductance": 1e-3})
    for arguments, named, word in (
            ((st.DCMotor(motor),), {}, "DCMotor"), ((st.GearedMotor(motor),), {}, "GearedMotor"),
            ((servo,), {}, "Servo"),
            ((model, st.loads.Recorded([0.0, 1.0], [0.0, 0.1])), {}, "recorded"), ((model,), {"name": "1x"}, "1x"),
            ((model,), {"name": "a-b"}, "a-b"), ((model,), {"name": 3}, "3"),
            ((model,), {"accuracy": 1.0}, "accuracy")):
        with pytest.raises(InputError, match=re.escape(word)) as caught:
            export.c(*arguments, **named)
        assert "\n" not in str(caught.value)


@pytest.mark.long
def test_files_are_replaced_only_where_that_is_asked_for(tmp_path):
    code = export.c(st.BoundedServo(st.load_servo(SERVO)), name="servo")
    header, source = code.write(tmp_path / "new" / "folder")
    source.write_text("mine")
    with pytest.raises(OutputExistsError):
        code.write(header.parent)
    assert source.read_text() == "mine"
    code.write(header.parent, overwrite=True)
    assert source.read_text() == code.source
    assert sorted(path.name for path in header.parent.iterdir()) == ["servo.c", "servo.h"]


@pytest.mark.long
def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    code = export.c(st.BoundedServo(st.load_servo(SERVO)), name="servo")
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot be written"):
        code.write(tmp_path / "file" / "below")



"""A servo as an FMU, as fmpy sets, steps and reads it: the same as `simulate`."""

import dataclasses
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.export import fmu
from servotwin.export.fmu import base_units
from servotwin.models import default_model

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
fmi2, fmi3 = (pytest.importorskip(f"fmpy.{name}") for name in ("fmi2", "fmi3"))
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu

PENDULUM = st.loads.Pendulum(mass=0.05, length=0.08)
SERVOS = {"pulse": ("hitec-hs-755hb", None), "pendulum": ("hitec-hs-755hb", PENDULUM),
          "bus": ("feetech-sts3215-12v", st.loads.Inertia(1e-4)), "program": ("miuzei-25kg", None)}
VERSIONS = ("2.0", "3.0")


class Tool:
    """A tool that loads an FMU and steps it."""

    def __init__(self, path, folder, *, early=False, **start):
        self.told = []
        self.about = fmpy.read_model_description(path)
        self.of = {each.name: each.valueReference for each in self.about.modelVariables}
        where = fmpy.extract(path, unzipdir=folder)
        self.newer = self.about.fmiVersion == "3.0"
        kind = fmi3.FMU3Slave if self.newer else fmi2.FMU2Slave
        token = self.about.instantiationToken if self.newer else self.about.guid
        self.slave = kind(guid=token, unzipDirectory=where, instanceName="one",
                          modelIdentifier=self.about.coSimulation.modelIdentifier)
        self.early = early
        self.begin(**start)

    def begin(self, **start):
        if self.newer:
            self.slave.instantiate(earlyReturnAllowed=self.early)
        else:
            self.slave.instantiate()
        self.initialize(**start)

    def initialize(self, **start):
        self.time = 0.0
        for name, value in start.items():
            self.set(name.replace("__", "."), value)
        if self.newer:
            self.slave.enterInitializationMode(startTime=0.0)
        else:
            self.slave.setupExperiment(startTime=0.0)
            self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def set(self, name, value):
        (self.slave.setFloat64 if self.newer else self.slave.setReal)([self.of[name]], [value])

    def get(self, name):
        return (self.slave.getFloat64 if self.newer else self.slave.getReal)([self.of[name]])[0]

    def step(self, step):
        if self.newer:
            *_, early, self.time = self.slave.doStep(self.time, step)
            return early
        self.slave.doStep(self.time, step)
        self.time += step
        return False


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    found = {}

    def of(kind, version):
        if (kind, version) not in found:
            name, load = SERVOS[kind]
            one = fmu(default_model(st.load_servo(name)), load, fmi=version)
            found[kind, version] = one.write(folder / f"{kind}{version[0]}.fmu")
        return str(found[kind, version])
    return of


def commands(kind):
    """Return a command and a torque at the beginning of each of some spans [s]."""
    if kind == "bus":
        return [(0.0, 0.0), (0.6, 0.0), (0.6, 0.4), (-0.3, 0.4), (-0.3, 0.0)]
    return [(1.3e-3, 0.0), (1.6e-3, 0.0), (1.6e-3, 0.2), (1.1e-3, 0.2), (1.1e-3, 0.0)]


def told(kind):
    return "command_angle" if kind == "bus" else "pulse_width"


def beside(kind, **changes):
    """Return the simulator of the same servo."""
    name, load = SERVOS[kind]
    return st.VectorSimulator(default_model(st.load_servo(name).replace(changes)), 1, load=load)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", SERVOS)
def test_it_has_nothing_that_a_tool_complains_about(made, kind, version):
    assert validate_fmu(made(kind, version)) == []


@pytest.mark.long
def test_a_name_is_no_code(tmp_path, monkeypatch):
    """A name that ended its comment ran code where a tool loaded the FMU; one of a header hid it from the compiler."""
    monkeypatch.chdir(tmp_path)
    name = '*/ __attribute__((constructor)) void planted(void) { fclose(fopen("planted", "w")); } /* ??/ \\'
    servo = dataclasses.replace(st.load_servo("hitec-hs-755hb"), name=name)
    tool = Tool(str(fmu(st.BoundedServo(servo)).write(tmp_path / "one.fmu")), tmp_path)
    assert tool.step(1e-3) is False
    assert not (tmp_path / "planted").exists()
    for taken in ("model", "component", "math", "fmi2"):
        with pytest.raises(InputError, match="not the name of a header"):
            fmu(st.BoundedServo(servo), name=taken)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", SERVOS)
@pytest.mark.parametrize("step", [1e-4, 1e-3, 7e-3, 20e-3])
def test_steps_of_any_length_are_those_of_a_simulator(made, tmp_path, kind, version, step):
    tool, lanes = Tool(made(kind, version), tmp_path), beside(kind)
    name, angle = told(kind), tool.get("output_angle")
    lanes.reset(output_angle=[angle], **{name: [tool.get(name)]})
    worst = 0.0
    for command, torque in commands(kind):
        tool.set(name, command)
        tool.set("external_torque", torque)
        for _ in range(max(round(0.1 / step), 3)):
            tool.step(step)
            lanes.advance(step, external_torque=[torque], **{name: [command]})
            worst = max(worst, abs(tool.get("output_angle") - lanes["output_angle"][0]))
    assert worst < 1e-9
    assert abs(tool.get("output_angle") - angle) > 0.05
    assert tool.get("armature_current") == pytest.approx(lanes["armature_current"][0], abs=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
def test_parameters_are_those_of_the_servo_until_it_begins(made, tmp_path, version):
    changes = {"motor.armature_resistance": 4.0, "supply.open_circuit_voltage": 5.0, "electronics.frame_period": 0.015}
    tool, lanes = Tool(made("pulse", version), tmp_path, **changes), beside("pulse", **changes)
    lanes.reset(output_angle=[tool.get("output_angle")], pulse_width=[tool.get("pulse_width")])
    tool.set("pulse_width", 1.7e-3)
    for _ in range(50):
        tool.step(4e-3)
        lanes.advance(4e-3, pulse_width=[1.7e-3])
    assert tool.get("output_angle") == pytest.approx(lanes["output_angle"][0], abs=1e-9)
    assert tool.get("motor.armature_resistance") == 4.0
    with pytest.raises(fmpy.fmi1.FMICallException):
        tool.set("motor.armature_resistance", 3.0)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("start", "words"), [
    ({"motor.armature_resistance": -1.0}, "more than 0"), ({"gear.gear_reduction": 0.5}, "at least 1"),
    ({"stops.lower_angle": 4.0}, "less than stops.upper_angle"), ({"start.frames_begin": 0.02}, "less than a frame"),
    ({"start.output_angle": 9.0}, "between its stops"), ({"pulse_width": float("nan")}, "finite")])
def test_what_cannot_be_is_refused_in_words(made, tmp_path, capsys, version, start, words):
    tool = Tool(made("pulse", version), tmp_path)
    tool.slave.reset()
    capsys.readouterr()
    with pytest.raises(fmpy.fmi1.FMICallException):
        tool.initialize(**start)
    said = capsys.readouterr().out
    assert next(iter(start)) in said
    assert words in said


@pytest.mark.parametrize("version", VERSIONS)
def test_a_command_that_it_does_not_take_changes_nothing(made, tmp_path, version):
    tool = Tool(made("pulse", version), tmp_path)
    tool.step(0.03)
    before = tool.get("output_angle")
    tool.set("pulse_width", 0.05)
    with pytest.raises(fmpy.fmi1.FMICallException):
        tool.step(0.01)
    tool.set("pulse_width", 1.4e-3)
    assert tool.get("output_angle") == before
    tool.step(0.01)


@pytest.mark.parametrize("version", VERSIONS)
def test_frames_begin_when_they_shall(made, tmp_path, version):
    """A pulse that begins 5 ms after the start moves the shaft no sooner."""
    tool = Tool(made("pulse", version), tmp_path, **{"start.frames_begin": 5e-3})
    rest = tool.get("output_angle")
    tool.set("pulse_width", 1.9e-3)
    tool.step(5e-3 + 0.9e-3)
    assert tool.get("output_angle") == rest
    tool.step(1.2e-3)
    assert abs(tool.get("output_angle") - rest) > 1e-6
    lanes = beside("pulse")
    lanes.reset(output_angle=[rest], pulse_width=[1.9e-3])
    lanes.advance(2.1e-3, pulse_width=[1.9e-3])
    assert tool.get("output_angle") == pytest.approx(lanes["output_angle"][0], abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", ["pulse", "bus"])
def test_a_state_goes_on_alike(made, tmp_path, kind, version):
    """Kept, taken up in another instance from bytes, and after a reset."""
    tool, other = (Tool(made(kind, version), tmp_path / name) for name in ("one", "two"))
    name = told(kind)
    slave = tool.slave
    newer = version == "3.0"

    def go(which, value, count):
        which.set(name, value)
        seen = []
        for _ in range(count):
            which.step(3e-3)
            seen.append(which.get("output_angle"))
        return seen

    value = 0.5 if kind == "bus" else 1.7e-3
    go(tool, value, 20)
    kept = slave.getFMUState() if newer else slave.getFMUstate()
    time = tool.time
    first = go(tool, 0.8 * value, 30)
    data = slave.serializeFMUState(kept) if newer else slave.serializeFMUstate(kept)
    (slave.setFMUState if newer else slave.setFMUstate)(kept)
    tool.time = time
    assert go(tool, 0.8 * value, 30) == first
    taken = (other.slave.deserializeFMUState if newer else other.slave.deSerializeFMUstate)(data)
    (other.slave.setFMUState if newer else other.slave.setFMUstate)(taken)
    other.time = time
    assert go(other, 0.8 * value, 30) == first
    slave.reset()
    tool.initialize()
    fresh = Tool(made(kind, version), tmp_path / "three")
    assert go(tool, value, 10) == go(fresh, value, 10)


def test_a_step_ends_with_the_frame_where_it_may(made, tmp_path):
    tool = Tool(made("pulse", "3.0"), tmp_path, early=True, **{"start.frames_begin": 6e-3})
    ends = []
    while tool.time < 0.05:
        early = tool.step(min(0.05 - tool.time, 0.03))
        ends.append((round(tool.time, 9), early))
    assert ends == [(0.006, True), (0.026, True), (0.046, True), (0.05, False)]


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_a_tool_builds_it_from_its_sources(tmp_path, monkeypatch, version):
    monkeypatch.setenv("PATH", os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])))
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    from fmpy.build import build_platform_binary

    model = default_model(st.load_servo("hitec-hs-755hb"))
    path = fmu(model, fmi=version, sources=True).write(tmp_path / "sources.fmu")
    with zipfile.ZipFile(path) as whole:
        whole.extractall(tmp_path / "sources")
    (tmp_path / "build").mkdir()
    build_platform_binary(tmp_path / "sources", build_dir=tmp_path / "build")
    assert list((tmp_path / "sources" / "binaries").rglob("hitec_hs_755hb.so"))


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
def test_its_sources_have_no_warning(tmp_path, version):
    compiler = next((each for each in ("clang", "gcc") if shutil.which(each)), None)
    if compiler is None:
        pytest.skip("no compiler of C is installed")
    made = fmu(default_model(st.load_servo("feetech-sts3215-12v")), fmi=version, sources=True)
    for name, content in made.contents.items():
        if name.startswith("sources/"):
            (tmp_path / name[8:]).write_bytes(content)
    for text in tmp_path.glob("*.c"):
        subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wno-strict-prototypes",
                        "-c", text, "-o", tmp_path / "object.o"], check=True)


@pytest.mark.long
def test_it_is_small_and_the_same_each_time(made, tmp_path):
    with zipfile.ZipFile(made("bus", "2.0")) as whole:
        sizes = [each.file_size for each in whole.infolist() if each.filename.startswith("binaries/")]
    assert 0 < max(sizes) < 200_000
    model = default_model(st.load_servo("hitec-hs-755hb"))
    one, two = (fmu(model, sources=True).write(tmp_path / name).read_bytes() for name in ("a.fmu", "b.fmu"))
    assert one == two


@pytest.mark.long
def test_bad_input(monkeypatch, tmp_path):
    model = default_model(st.load_servo("hitec-hs-755hb"))
    with pytest.raises(InputError, match="fmi"):
        fmu(model, fmi="1.0")
    with pytest.raises(InputError, match="Motor"):
        fmu(st.DCMotor(st.load_servo("hitec-hs-755hb")))
    monkeypatch.setattr(sys.modules["servotwin.export.fmu"], "compilers", lambda: ())
    with pytest.raises(InputError, match="ziglang"):
        fmu(model)
    path = fmu(model, sources=True).write(tmp_path / "a.fmu")
    with pytest.raises(st.errors.OutputExistsError):
        fmu(model, sources=True).write(path)


@pytest.mark.parametrize(("unit", "powers"), [
    ("V s/rad", {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1}), ("kg m2", {"kg": 1, "m": 2}), ("1", {}),
    ("s2/rad", {"s": 2, "rad": -1}), ("K/W", {"K": 1, "kg": -1, "m": -2, "s": 3})])
def test_units_are_those_of_the_si(unit, powers):
    assert base_units(unit) == powers

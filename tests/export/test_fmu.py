"""A servo as an FMU, as fmpy sets, steps and reads it: the same as `simulate`."""

import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.export import fmu
from servotwin.export.fmu_variables import base_units
from servotwin.models import default_model

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
from fmpy import fmi2, fmi3  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

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


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", SERVOS)
def test_it_has_nothing_that_a_tool_complains_about(made, kind, version):
    assert validate_fmu(made(kind, version)) == []


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

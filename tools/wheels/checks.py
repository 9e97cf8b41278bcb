"""What a wheel does on a machine without compiler; `try_wheel.py` runs this in an environment of its own."""

import json
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.compile.finding import built, compilers, levels, shipped_folder
from servotwin.simulation.compile.library import loaded
from servotwin.simulation.recipes import all_recipes

STEP = st.signals.step(10.0, 50.0, at=0.02, unit="deg")
# Terms that no servo of the catalog has, all at once
RARE = {
    "supply.current_limit": 1.2, "gear.backlash": 0.01, "gear.output_inertia": 1e-3, "potentiometer.backlash": 0.005,
    "friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5,
    "friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1, "thermal.winding_capacity": 2.0,
    "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0, "thermal.housing_to_ambient": 10.0}


@pytest.fixture(scope="module")
def servo():
    return st.load_servo("hitec-hs-755hb")


def test_nothing_here_compiles():
    assert compilers() == ()
    assert Path(st.__file__).is_relative_to(sys.prefix)


@pytest.mark.parametrize("recipe", all_recipes(), ids=lambda recipe: recipe.name)
def test_each_recipe_has_a_library_for_this_processor(recipe):
    path = next(built(recipe)).path
    assert path.parent == shipped_folder()
    names = [f"{recipe.name}-{level}{path.suffix}" for level in levels()]
    assert path.name == next(name for name in names if (shipped_folder() / name).exists())
    kernels = loaded(recipe)
    assert kernels is not None
    for entry in recipe.entries:
        assert all(function.address for function in getattr(kernels, entry.split(":")[1]).functions)


def test_the_package_loads_nothing_but_numpy():
    code = ("import sys; before = set(sys.modules); import servotwin, json, sysconfig;"
            "own = {m: getattr(sys.modules[m], '__file__', None) for m in set(sys.modules) - before if '.' not in m};"
            "print(json.dumps([m for m, f in own.items() if f and not f.startswith(sysconfig.get_path('stdlib'))]))")
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True)
    assert {"servotwin"} <= set(json.loads(done.stdout)) <= {"numpy", "servotwin"}


def test_many_servos_of_a_file_with_terms_that_the_catalog_lacks(servo, tmp_path):
    servo.replace(RARE).save(tmp_path / "mine.toml")
    model = st.PulseServoInductive(st.load_servo(tmp_path / "mine.toml"))
    alone = st.simulate(model, STEP, duration=0.3, output_step=0.01)["output_angle"]
    many = st.simulate_many(model, STEP, duration=0.3, output_step=0.01, parameters={"motor.armature_resistance": [
        model.servo.motor.armature_resistance] * 4})
    assert np.ptp(alone) > 0.1
    np.testing.assert_allclose(many["output_angle"], np.tile(alone, (4, 1)), rtol=0.0, atol=1e-6)


def test_a_vector_of_servos_goes_on_at_every_tick(servo):
    sims = st.VectorSimulator(st.PulseServo(servo), 8)
    before = sims["output_angle"].copy()
    for _ in range(100):
        sims.advance(1e-3, pulse_width=np.linspace(1.2e-3, 1.8e-3, 8))
    assert np.all(np.diff(sims["output_angle"]) > 0.0)
    assert np.any(np.abs(sims["output_angle"] - before) > 0.05)


def test_parameters_are_found_from_a_log(servo):
    mine = servo.replace({"electronics.stretcher_gain": 90.0})
    time = np.arange(0.0, 1.5, 0.02)
    width = 1.5e-3 + np.repeat([0.0, 3e-4, -3e-4], 25)
    run = st.simulate(st.PulseServo(mine), st.signals.samples(time, width, unit="s"), duration=1.5, output_step=1e-3)
    log = st.Log(name="steps", motion="steps", load=st.loads.Load(), time=time, command=width,
                 command_kind="pulse_width", measured={"output_angle": np.interp(time, run.time, run["output_angle"])})
    fit = st.identify([log], servo, free=["electronics.stretcher_gain"])
    assert fit.estimates["electronics.stretcher_gain"] == pytest.approx(90.0, rel=0.02)


def test_a_servo_drives_a_joint(servo):
    mujoco = pytest.importorskip("mujoco")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.001"/><worldbody><body><joint name="j" axis="0 0 1"/>'
        '<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/></body></worldbody></mujoco>'),
        {"j": st.PulseServo(servo)}, assume_heat=False)
    data = mujoco.MjData(drive.model)
    drive.command(data, {"j": 0.5})
    for _ in range(1000):
        drive.step(data)
    assert data.qpos[0] == pytest.approx(0.5, abs=0.05)


def test_the_page_is_served(tmp_path):
    pytest.importorskip("uvicorn")
    command = [sys.executable, "-m", "servotwin", "web", "--port", "0", "--no-open", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        try:
            text = ""
            while not text.endswith("}\n"):
                line = process.stdout.readline()
                assert line, "it has ended"
                text += line
            with urllib.request.urlopen(json.loads(text)["page"], timeout=20) as answer:
                assert answer.status == 200
        finally:
            process.kill()

"""Kernels in plain Python say what the engine says that they are derived from, whichever way they are called."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

LAWS = Path(__file__).parents[1] / "physics" / "one_law_runs.py"
CLOSED_FORM = ("tiles", "tiles that measure", "digital")
INTEGRATED = ("loaded", "sprung", "bounded")
HEAD = """
import json, sys
import numpy as np
import servotwin as st
model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
step = st.signals.step(10.0, 50.0, at=0.005, unit="deg")
"""
LOST = """
loads = [st.loads.Constant(torque) for torque in (0.05, 1e307, 0.05)]
batch = st.simulate_many(model, step, duration=0.05, load=loads, output_step=0.01, outputs=("output_angle",))
alone = st.simulate(model, step, duration=0.05, load=loads[0], output_step=0.01)
sims = st.VectorSimulator(model, 3, load=loads)
sims.reset(pulse_width=1000e-6)
sims.advance(0.05, pulse_width=1500e-6)
print(json.dumps({
    "causes": [[lane, cause] for lane, _, cause in batch.failures],
    "cause": st.simulate(model, step, duration=0.05, load=loads[1]).cause,
    "off": float(np.abs(batch["output_angle"][[0, 2]] - alone["output_angle"]).max()),
    "lost": bool(np.isnan(batch["output_angle"][1, -1])), "status": sims.status.tolist(),
    "angles": sims["output_angle"].tolist()}))
"""
BUS = """
supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.3)
pulse = st.signals.constant(1500.0, unit="us")
start = float(st.Simulator(model).initial(st.signals.constant(1000.0, unit="us"))["output_angle"])
servos = {name: (model, pulse, st.loads.Inertia(J)) for name, J in (("a", 1e-4), ("b", 1e-3))}
fleet = st.simulate_bus(servos, supply=supply, duration=0.1, output_step=0.1,
                        initial={name: {"output_angle": start} for name in servos})
sims = st.VectorSimulator(model, 2, bus=supply, load=[st.loads.Inertia(1e-4), st.loads.Inertia(1e-3)])
sims.reset(pulse_width=1500e-6, output_angle=start)
for _ in range(10):
    sims.advance(0.01)
print(json.dumps({name: [fleet[own][name][-1] for own in servos] + sims[name].tolist()
                  for name in ("output_angle", "output_speed", "bus_voltage")}))
"""
FROM_C = """
model = [model, st.DigitalServo(st.load_servo("feetech-sts3215-12v"))][int(sys.argv[1])]
sims = [st.VectorSimulator(model, 2) for _ in range(2)]
for some in sims:
    some.reset(command_angle=0.3)
entry, seen = sims[0].c_entry(), {name: np.empty(2) for name in ("output_angle", "load_torque", "armature_current")}
goal = np.array([0.8, 0.5])
tick = entry.tick(duration=0.005, command_angle=goal, external_torque=np.array([0.02, 0.0]), **seen)
for _ in range(10):
    entry.advance(tick)
    sims[1].advance(0.005, command_angle=goal, external_torque=[0.02, 0.0])
tick.duration = -1.0
try:
    entry.advance(tick)
except ValueError as error:
    refused = str(error)
print(json.dumps({"refused": refused, **{name: [*seen[name], *sims[1][name]] for name in seen}}))
"""


def process(text, *arguments, backend="plain"):
    return subprocess.run([sys.executable, "-W", "error", "-c", HEAD + text, *arguments], text=True,
                          capture_output=True, env={**os.environ, "SERVOTWIN_BACKEND": backend}, check=False)


def run(text, *arguments):
    done = process(text, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


@pytest.mark.long
@pytest.mark.parametrize(("cases", "most"), [(CLOSED_FORM, 1e-12), (INTEGRATED, 1e-9)])
def test_lanes_in_plain_python_are_the_engine(tmp_path, cases, most):
    out = tmp_path / "signals.npz"
    subprocess.run([sys.executable, str(LAWS), str(out), "backend", *cases], check=True, capture_output=True,
                   env={**os.environ, "SERVOTWIN_BACKEND": "plain"})
    with np.load(out) as found:
        pairs = {key: (values, found["plain/" + key.partition("/")[2]]) for key, values in found.items()
                 if key.startswith("batch/")}
    assert {key.split("/")[1].partition(",")[0] for key in pairs} == set(cases)
    for key, (values, plain) in pairs.items():
        size = max(np.nanmax(np.abs(plain), initial=0.0), 1e-6)
        np.testing.assert_allclose(values / size, plain / size, rtol=0.0, atol=most, err_msg=key)


@pytest.mark.long
def test_a_lane_beyond_floats_fails_alone():
    found = run(LOST)
    assert found["causes"] == [[1, found["cause"]]]
    assert found["status"] == [0, 1, 0]  # DIVERGED
    assert found["lost"]
    assert np.isnan(found["angles"]).tolist() == [False, True, False]
    assert found["off"] < 1e-12


@pytest.mark.long
def test_a_shared_supply():
    for name, (*fleet, a, b) in run(BUS).items():
        assert [a, b] == pytest.approx(fleet, rel=1e-12, abs=1e-12), name


@pytest.mark.long
@pytest.mark.parametrize("servo", [0, 1])
def test_a_tick_from_c(servo):
    found = run(FROM_C, str(servo))
    assert "duration" in found.pop("refused")
    for name, numbers in found.items():
        assert numbers[:2] == numbers[2:], name


@pytest.mark.parametrize("asked", ["Plain", "fast"])
def test_another_backend_is_refused_in_a_line(asked):
    done = process("st.VectorSimulator(model, 1)", backend=asked)
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"servotwin.errors.InputError: environment variable SERVOTWIN_BACKEND: got '{asked}'")

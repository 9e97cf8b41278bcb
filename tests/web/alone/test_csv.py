"""Logs as plain tables: the page as one file reads them, and lays them over a twin, as the server does."""

import warnings

import numpy as np
import pytest

import servotwin as st
from bench_made import in_node
from servotwin.errors import InputError
from servotwin.logs import read_logs
from servotwin.web.live import read_scene
from servotwin.web.live.live_bench import load_of, models_of
from servotwin.web.live.overlay import compared, of_the_bench
from servotwin.web.server.own import reading

pytestmark = pytest.mark.long

SCENE = ('format = 1\n[[servo]]\nid = "{id}"\nmodel = "{model}"\n[servo.parameters]\n"{name}" = {value}\n'
         '[load]\ninertia = 1e-4\n')
SERVOS = {
    "pulses": ("hitec-hs-755hb", "PulseServo", "motor.rotor_inertia", 1e-7, "us", (1400.0, 1650.0)),
    "bounded": ("hitec-hs-755hb", "BoundedServo", "motor.rotor_inertia", 1e-7, "us", (1400.0, 1650.0)),
    "angles": ("hitec-hs-755hb", "PulseServo", "motor.rotor_inertia", 1e-7, "deg", (60.0, 110.0)),
    "bus": ("feetech-sts3215-12v", "DigitalServo", "motor.armature_resistance", 4.0, "deg", (-30.0, 30.0))}
NAMES = {"us": "pulse_width", "deg": "command_angle"}


def table_of(kind, tmp_path):
    """Return the text of a log of a servo that differs from the twin, and the scene of the twin."""
    servo, model, name, value, unit, ends = SERVOS[kind]
    made = getattr(st, model)(st.load_servo(servo))
    told = st.signals.samples([0.0, 0.2, 0.8, 1.2], [ends[0], ends[1], ends[0], ends[1]], unit=unit)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = st.simulate(made, told, duration=1.6, output_step=0.02, load=st.loads.Inertia(1e-4))
    factor, suffix = (1e6, "us") if unit == "us" else (180.0 / np.pi, "deg")
    head = f"time_s,{NAMES[unit]}_{suffix},output_angle_deg,armature_current_mA\n"
    angle, current = np.degrees(run["output_angle"]), 1e3 * run["armature_current"]
    columns = (run.time + 3.0, factor * run[NAMES[unit]], angle, current)
    rows = "".join(",".join(f"{x:.12g}" for x in row) + "\n" for row in zip(*columns, strict=True))
    return head + rows, SCENE.format(id=servo, model=model, name=name, value=value)


def alike(ours, theirs):
    """Assert that plain data are the same, numbers but for rounding."""
    if isinstance(theirs, dict | list | tuple):
        assert len(ours) == len(theirs)
        for key in theirs if isinstance(theirs, dict) else range(len(theirs)):
            alike(ours[key], theirs[key])
    else:
        assert ours == (pytest.approx(theirs, rel=1e-12) if isinstance(theirs, float) else theirs)


@pytest.mark.parametrize("kind", SERVOS)
def test_a_table_is_read_and_laid_over_its_twin_as_by_the_server(folder, tmp_path, kind):
    text, scene_text = table_of(kind, tmp_path)
    found, = in_node("logs", folder, jobs=[{"scene": scene_text, "csv": text + "9", "name": "mine.csv"}])
    (tmp_path / "mine.csv").write_text(text + "9")
    log, = read_logs(tmp_path / "mine.csv")
    theirs = reading.log_facts([log], "mine.csv", [])
    assert theirs.pop("computed") is False
    alike(found["facts"], theirs)
    scene = read_scene(scene_text)
    model, = models_of(scene)
    log = of_the_bench(log, type(model), model.servo, load_of(scene), 50.0)
    twin, page = compared(log, model.servo, type(model), fit_rig=False), found["overlay"]
    assert twin["rms"] > 0.01
    assert page["rms"] == pytest.approx(twin["rms"], rel=1e-4)
    assert page["worst"] == pytest.approx(twin["worst"], rel=1e-4)
    for name in ("log", "signal", "unit", "samples", "model", "servo", "worst_at"):
        assert page[name] == pytest.approx(twin[name]) if name == "worst_at" else page[name] == twin[name], name
    for name in ("time", "measured", "simulated"):
        np.testing.assert_allclose(page[name], twin[name], rtol=1e-5, atol=1e-4, err_msg=name)


HEAD = "time_s,pulse_width_us,output_angle_deg\n"
GOOD = HEAD + "0,1500,90\n0.02,1500,90\n0.04,1500,90\n"
BOTH = {  # what server and page refuse
    "": "empty file", HEAD: "rows", HEAD + "0,1500,90\n": "at least 3",
    HEAD + "0,x,90\n1,1500,90\n2,1500,90\n": "line 2",
    HEAD + "0,1500,90\n1,-1500,90\n2,1500,90\n": "a positive width", GOOD.replace("_us", "_s"): "microseconds?",
    GOOD.replace("_deg", "_rad").replace("90", "9000"): "degrees", GOOD.replace("0.04", "0.02"): "time",
    GOOD.replace("1500,90\n0.04", "1500\n0.04"): "cells"}
SERVER_ONLY = (GOOD.replace(",", ";"), "# by hand\n" + GOOD, GOOD.replace("output_angle_deg", "pos [deg]"),
               GOOD.replace("90", '"90"'))
DOUBTFUL = (GOOD.replace("0,1500", "0,0", 1), HEAD + "".join(f"{k},1500,9{k}\n" for k in range(9)) + "9,15,99\n",
            HEAD + "0,1500,980\n1,1500,1.020\n2,1500,1.400\n")  # no pulse, a torn row, thousands: to be asked about


def test_what_is_no_plain_log_is_refused_in_a_line(folder, tmp_path):
    scene = SCENE.format(id="hitec-hs-755hb", model="PulseServo", name="motor.rotor_inertia", value=1e-7)
    texts = [*BOTH, *SERVER_ONLY, *DOUBTFUL]
    found = in_node("logs", folder, jobs=[{"scene": scene, "csv": text, "name": "mine.csv"} for text in texts])
    for text, one in zip(texts, found, strict=True):
        assert "\n" not in one["refused"], text
        assert one["refused"].startswith("mine.csv"), text
        file = tmp_path / "mine.csv"
        file.write_text(text)
        if text in BOTH:
            assert BOTH[text] in one["refused"], text
            with pytest.raises(InputError):
                read_logs(file)
        else:
            assert "the server's page (servotwin web)" in one["refused"], text
            if text in SERVER_ONLY:
                assert len(read_logs(file)[0]) == 3

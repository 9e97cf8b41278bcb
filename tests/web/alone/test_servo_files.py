"""Servo files at the page as one file: what it writes is what the package writes, and it reads those again."""

import json
import warnings

import pytest

import servotwin as st
from bench_made import in_node
from servotwin.errors import ServotwinError
from servotwin.parameters import catalog_names
from servotwin.parameters.servo_file import read_servo_text, servo_text
from servotwin.web.live import Scene, SceneServo
from servotwin.web.live.live_bench import models_of


def scene_of(text):
    """Return the bench of a servo file, as the page makes one of a file that is opened."""
    return f"format = 1\n[[servo]]\nfile = {json.dumps(text, ensure_ascii=False)}\n[load]\ninertia = 1e-4\n"


@pytest.mark.long
def test_the_file_of_every_catalog_servo_is_the_packages(folder):
    scenes, servos = [], []
    for name in catalog_names():
        scene = Scene(servos=(SceneServo(id=name),), load={"inertia": 1e-4})
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                servos.append(models_of(scene)[0].servo)
        except ServotwinError:
            continue
        scenes.append(scene.text())
    assert len(scenes) > 40
    files = [one["text"] for one in in_node("files", folder, scenes=scenes)]
    for servo, text in zip(servos, files, strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made = read_servo_text(text, "servo file")
        assert made == servo, servo.name
        assert (dict(made.sheet), made.notes) == (dict(servo.sheet), servo.notes)
        assert {name: made.source(name) for name in made.names()} == {
            name: servo.source(name) for name in servo.names()}
    again = in_node("files", folder, scenes=[scene_of(text) for text in files])
    assert [one.get("text") for one in again] == files


def test_a_file_with_other_numbers_in_other_units_is_read(folder):
    servo = st.load_servo("hitec-hs-755hb")
    text = servo_text(servo.replace({"electronics.deadband": 2e-5, "electronics.off_state": "coast"}))
    lines = text.splitlines()
    at, = (k for k, line in enumerate(lines) if line.startswith("armature_resistance"))
    lines[at] = 'armature_resistance = {value = 4500.0, unit = "mohm", origin = "assumed"}'
    found, = in_node("files", folder, scenes=[scene_of("\n".join(lines))])
    made = read_servo_text(found["text"], "servo file")
    names = ("electronics.deadband", "electronics.off_state", "motor.armature_resistance")
    assert [made.get(name) for name in names] == [2e-5, "coast", pytest.approx(4.5, rel=1e-12)]
    assert made.motor.rotor_inertia == servo.motor.rotor_inertia


@pytest.mark.long(but="<lambda>-no electronics")
@pytest.mark.parametrize(("mistake", "words"), [
    (lambda text: text.replace('name = "hitec-hs-755hb"', 'name = "mine"'), "'mine'"),
    (lambda text: text.replace("\ndeadband = ", "\ndead_band = "), "'electronics.dead_band'"),
    (lambda text: text.replace('unit = "kg m2"', 'unit = "stone"', 1), "in stone"),
    (lambda text: "\n".join(line for line in text.splitlines() if not line.startswith("deadband ")), "no electronics"),
    (lambda text: text + "\n[", "not valid TOML")])
def test_another_file_is_refused_in_a_line(folder, mistake, words):
    text = servo_text(st.load_servo("hitec-hs-755hb"))
    assert mistake(text) != text
    found, = in_node("files", folder, scenes=[scene_of(mistake(text))])
    assert words in found["refused"]
    assert "\n" not in found["refused"]
    mystery, = in_node("files", folder, scenes=["format = 1\n[[servo]]\nmystery = 3\nmodel = \"PulseServo\"\n"])
    assert mystery["refused"] == "servo file of a mystery servo: allowed: none: find out what it is"

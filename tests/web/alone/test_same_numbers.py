"""Benches of the page as one file and of the server: random scenes, random actions, the same numbers and words."""

import json
from functools import partial

import pytest

from bench_compare import compare
from bench_made import benches, wild
from bench_scenes import ON_A_SUPPLY, by_python, drawn
from servotwin.web.live import LiveBench, read_scene


@pytest.mark.long
def test_some_benches(folder):
    refused, moved = compare(partial(benches, folder), range(12))
    assert refused > 3
    assert moved > 5


@pytest.mark.long
def test_benches_with_a_control_circuit(folder):
    seeds = [seed for seed in range(200) if "[control]" in drawn(seed)["scene"]][:4]
    _, moved = compare(partial(benches, folder), seeds)
    assert len(seeds) > 3
    assert moved > 2


@pytest.mark.long
def test_programs_and_chips_share_a_supply(folder):
    draw = partial(drawn, servos=3, kinds=ON_A_SUPPLY)
    seeds = [seed for seed in range(150) if "[supply]" in draw(seed)["scene"] and "DigitalServo" in draw(seed)["scene"]
             and "PulseServo" in draw(seed)["scene"]][:10]
    _, moved = compare(partial(benches, folder), seeds, draw)
    assert len(seeds) == 10
    assert moved > 8


@pytest.mark.slow
def test_eighty_benches(folder):
    refused, moved = compare(partial(benches, folder), range(1000, 1080))
    assert refused > 40
    assert moved > 60


@pytest.mark.long
def test_texts_are_refused_in_the_same_words(folder):
    """Each text is that of a scene with one mistake."""
    good = 'format = 1\nservo = [{id = "hitec-hs-755hb"}]\n'
    texts = [good + line for line in (
        'seed = -1', 'frame_rate = 5000', 'end = -1', 'load = {inertia = "x"}', 'load = {weight = 1}', 'name = 3',
        'actions = [[0.5, "push"]]', 'actions = [[-1, "push", 0.1]]', 'actions = [[0, "jump", 1]]',
        'actions = [[1, "push", 0.1], [0.5, "push", 0.1]]', 'actions = [[0, "push", 0.1, 3]]',
        'actions = [[0, "frames", {rate = 50}, 0]]', 'actions = [[0, "torque", 1]]', 'actions = [[0, "set", {}]]',
        'actions = [[0, "command", {shape = "saw"}]]', 'actions = [[0, "command", {shape = "hold", value = 1}]]',
        'actions = [[0, "command", {shape = "hold", unit = "us", value = 1500, low = 1}]]',
        'actions = [[0, "command", {shape = "recorded", unit = "us", time = [0], value = [1]}]]',
        'actions = [[0, "command", {shape = "recorded", unit = "us", time = [0, 1], value = [1]}]]',
        'lesson = {title = 3}', 'other = 3', 'load = 3', 'frame_rat = 50', 'load = {inerta = 1}',
        'actions = [[0, "comand", {}]]', 'actions = [[0, "command", {shape = "hld"}]]')]
    texts += [f'format = 1\nservo = [{{id = "hitec-hs-755hb", model = "{name}"}}]\n' for name in ("pulse", "Bound")]
    texts += ['format = 2\nservo = [{id = "x"}]', 'format = 1', 'format = 1\nservo = [{}]',
              'format = 1\nservo = [{id = "a", mystery = 3}]', 'format = 1\nservo = [{id = "a", of = 3}]',
              'format = 1\nservo = [{id = "a", model = "Servo"}]', 'format = 1\nservo = [{id = 3}]']
    found = benches(folder, [{"scene": text, "steps": [], "rate": 60.0, "switches": True} for text in texts])
    for text, one in zip(texts, found, strict=True):
        with pytest.raises(ValueError, match=r".") as error:
            read_scene(text)
        words = " ".join(str(error.value).split())
        assert one["refused"] == [words], json.dumps(text)


SERVOS = ("hs-755", "hs755hb", "sg90", "MG996R", "x", "ß", "xl330", "sts 3215", "m" * 300)
NAMES = ("resistance", "motor.resistance", "motor.armature_resistanc", "gear.ratio", "play", "voltage", "motr.inertia",
         "motor.", "electronics.dead_band", "foo.bar", "friction.coulomb")


def test_what_a_misspelt_name_may_mean_is_said_in_the_same_words(folder):
    scenes = [f'format = 1\nservo = [{{id = "{name}"}}]\n' for name in SERVOS]
    scenes += [f'format = 1\nservo = [{{id = "hitec-hs-755hb", parameters = {{"{name}" = 3.0}}}}]\n' for name in NAMES]
    found = benches(folder, [{"scene": text, "steps": [], "rate": 60.0, "switches": True} for text in scenes])
    for text, one in zip(scenes, found, strict=True):
        with pytest.raises(ValueError, match=r".") as error:
            LiveBench(read_scene(text))
        assert one["refused"] == [" ".join(str(error.value).split())], text
    change = [{"until": 0.0, "kind": "set", "value": {name: 3.0}} for name in NAMES]
    job = {"scene": 'format = 1\nservo = [{id = "hitec-hs-755hb"}]\n', "steps": change, "rate": 60.0, "switches": True}
    assert benches(folder, [job])[0]["refused"] == by_python(job)["refused"]


@pytest.mark.parametrize("model", ["BoundedServo", "PulseServo", "PulseServoInductive", "AveragedServo"])
def test_no_number_lets_the_kernel_trap(folder, model):
    text = f'format = 1\nservo = [{{id = "hitec-hs-755hb", model = "{model}"}}]\n[load]\ninertia = 1e-4\n'
    assert wild(folder, [text]) == 36


def test_no_number_lets_the_kernel_of_a_program_or_a_bus_trap(folder):
    digital = 'format = 1\nservo = [{id = "feetech-sts3215-12v"}]\n[load]\ninertia = 1e-4\n'
    bus = 'format = 1\nservo = [{id = "hitec-hs-755hb"}, {id = "hitec-hs-755hb"}]\n[load]\ninertia = 1e-4\n[supply]\n'
    assert wild(folder, [digital, bus + "open_circuit_voltage = 6.0\ninternal_resistance = 0.5\n"]) == 72

"""Each lesson does what its text says."""

import math
from dataclasses import replace

import numpy as np
import pytest

from servotwin.errors import InputError, UnknownNameError
from servotwin.web.lessons import lessons as taught
from servotwin.web.lessons import mystery
from servotwin.web.live import LiveBench, Scene, SceneServo, read_scene, replay


def run_of(name: str, end: float):
    return replay(replace(taught.lesson(name).scene, end=end), output_step=2e-3)


def degrees(run, servo: int, start: float, end: float) -> np.ndarray:
    time = run[servo]["time"]
    return np.degrees(run[servo]["output_angle"][(time >= start) & (time <= end)])


def test_deadband_moves_after_half_of_it():
    run = run_of("deadband", 6.0)
    time, angle = run[0]["time"], np.degrees(run[0]["output_angle"])
    first = time[np.argmax(abs(angle - angle[0]) > 1e-3)]
    assert 1e6 * run[0]["pulse_width"][time < first][-1] == pytest.approx(1505.0, abs=1.0)  # 4 us are not yet enough
    assert not run[0]["drive"][time < first - 0.021].any()
    assert angle[-1] > angle[0] + 0.5


def test_droop_grows_with_the_weight():
    run = run_of("droop", 9.0)
    at = [degrees(run, 0, end - 0.4, end).mean() for end in (1.0, 3.0, 5.0, 7.0, 9.0)]
    assert at[1] == pytest.approx(at[0], abs=1e-6)
    assert np.all(np.diff(at[1:]) < -1.0)


def test_frames_that_are_rare_take_long():
    run = run_of("frames", 12.4)
    took = []
    for start in (2.5, 6.5, 10.5):  # the command goes up
        time = run[0]["time"]
        up = (time >= start) & (run[0]["output_angle"] > math.radians(114.0))
        took.append(time[np.argmax(up)] - start)
    assert took[0] > 2.5 * took[1] > 0.3
    assert took[2] > 0.7 * took[1]
    assert degrees(run, 0, 12.0, 12.4).mean() > degrees(run, 0, 8.0, 8.4).mean()  # it holds better


def test_a_servo_that_coasts_runs_past_its_command():
    run = run_of("brake-or-coast", 3.4)
    assert degrees(run, 0, 2.0, 3.4).max() < 120.0
    assert degrees(run, 1, 2.0, 3.4).max() > 123.0


def test_vibration_ends_when_the_knob_has_its_own_supply():
    run = run_of("vibration", 7.0)
    shaken, still = degrees(run, 0, 1.5, 4.0), degrees(run, 0, 6.0, 7.0)
    assert np.ptp(shaken) > 1.0
    assert abs(np.diff(np.sign(np.diff(shaken[::5])))).sum() > 20  # it goes on turning round
    assert shaken.max() < 85.0
    assert still.mean() == pytest.approx(90.0, abs=2.0)
    assert np.ptp(still) < 0.5


@pytest.mark.long
def test_brown_out_comes_where_two_start_at_once():
    run = run_of("brown-out", 7.5)
    alone, both, mended = ([degrees(run, k, *span).mean() for k in (0, 1)] for span in
                           ((1.7, 2.0), (4.7, 5.0), (7.2, 7.5)))
    time = run[0]["time"]
    np.testing.assert_allclose(run[0]["bus_voltage"], run[1]["bus_voltage"], rtol=1e-12)
    assert alone[0] > 25.0
    assert alone[1] == pytest.approx(-30.0, abs=1.5)
    assert max(both) < -25.0
    assert min(mended) > 25.0
    tripped = [[time[run[k]["trip"] > 0.0].min(), time[run[k]["trip"] > 0.0].max()] for k in (0, 1)]
    assert np.all((np.array(tripped) > 3.5) & (np.array(tripped) < 4.0))  # for moments: nobody sees it later


def test_play_lets_the_horn_move_while_the_motor_stands():
    run = run_of("play", 5.9)
    assert np.ptp(degrees(run, 0, 1.0, 5.9)) < 0.1
    assert 1.2 < np.ptp(degrees(run, 1, 1.0, 5.0)) < 3.0  # 2 degrees of play, and what the servo makes of it


@pytest.mark.long
def test_p_is_a_stiffness():
    run = run_of("p-gain", 4.0)
    soft, stiff = (-degrees(run, k, 3.5, 4.0).mean() for k in (0, 1))
    assert soft > 1.5
    assert stiff == pytest.approx(0.5 * soft, rel=0.2)  # friction holds either a little off where it would hang


@pytest.mark.parametrize("lesson", taught.lessons(), ids=lambda lesson: lesson.name)
def test_a_lesson_is_short_and_whole(lesson):
    assert all(line.endswith(".") and line.count(". ") == 0 for line in lesson.look)
    assert lesson.question.endswith("?")
    assert read_scene(lesson.scene.text()) == lesson.scene
    assert LiveBench(lesson.scene).time == 0.0


def test_what_is_no_lesson_is_told():
    with pytest.raises(UnknownNameError, match="deadband"):
        taught.lesson("dedband")
    with pytest.raises(InputError, match="three sentences"):
        taught.read_lesson("x", 'format = 1\n[[servo]]\nid = "hitec-hs-755hb"\n[lesson]\nlook = ["One."]')


def test_a_mystery_is_the_same_for_the_same_seed_and_another_for_another():
    assert mystery.truth(3) == mystery.truth(3) != mystery.truth(4)
    for one in mystery.unknowns():
        assert one["low"] < mystery.truth(3)[one["name"]] < one["high"]


def test_a_pupil_finds_the_deadband_of_a_mystery_servo():
    bench = LiveBench(Scene(servos=(SceneServo(mystery=11, model="PulseServo"),)))
    place = bench.columns[0].index("output_angle")
    widths = []
    for start, way in ((1500.0, 1.0), (1560.0, -1.0)):  # from below and from above, until it answers
        bench.do("command", {"shape": "hold", "unit": "us", "value": start})
        bench.advance(bench.time + 4.0, 50.0)
        rest, width = bench.rows[0][place], start
        while abs(bench.rows[0][place] - rest) < 1e-4:
            width += 0.25 * way
            bench.do("command", {"shape": "hold", "unit": "us", "value": width})
            bench.advance(bench.time + 0.1, 50.0)
        widths.append((width, rest))
    (up, low), (down, high) = widths
    model = bench.models[0]
    centres = [1e6 * float(model.command(_angle(angle)).table[0].value) for angle in (low, high)]
    half = 0.5 * ((up - centres[0]) + (centres[1] - down))
    compared = mystery.compare(11, {"electronics.deadband": 2e-6 * half})
    assert compared[0]["said"] in ("found", "near")
    assert [row["truth"] for row in compared[1:]] == [None] * 4  # what was not guessed stays hidden


def _angle(angle: float):
    import servotwin as st

    return st.signals.constant(angle, unit="rad")

"""The angle of a horn out of a clip: drawn clips whose angle is known, through a codec, as the user reads them."""

import json
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2", reason="the extra `video` is not installed")

import servotwin as st  # noqa: E402
from bench.clips import Scene, corners, cut_in_front, film, pictures, with_times  # noqa: E402
from servotwin.bench.video import mark_bytes, read_clip, write_film_log  # noqa: E402
from servotwin.bench.video.film_log import film_log  # noqa: E402
from servotwin.bench.video.filmed import (  # noqa: E402
    SQUARE,
    Finder,
    fit_plane,
    mapped,
    sharpened,
    turned,
)
from servotwin.bench.video.marker import jump  # noqa: E402
from servotwin.errors import InputError, MissingExtraError, OutputExistsError  # noqa: E402

RATE = 30.0
TIMES = np.arange(50) / RATE
EXPOSURE = Scene().exposure
START = 0.45  # s in the clip, at which the log begins


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(before)


def moves(time, levels=(0.0, 0.7, -0.6, 0.3), speed=5.0):
    """Smooth moves at 0.4, 0.8 and 1.2 s [rad]; 5 rad/s on average are 430 deg/s at most."""
    angle = levels[0]
    for k, (a, b) in enumerate(pairwise(levels), 1):
        share = np.clip((time - 0.4 * k) * speed / abs(b - a), 0.0, 1.0)
        angle = angle + (b - a) * (3.0 * share**2 - 2.0 * share**3)
    return angle


def error(filmed, angle=moves, later=0.5 * EXPOSURE):
    """Angle minus truth in the middle of the exposure, both from the first picture on [deg]."""
    time = filmed.time + filmed.instant.time
    return np.degrees(filmed.angle - (angle(time + later) - angle(time[0] + later)))


def rms(values):
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean((values - values.mean())**2)))


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return film(tmp_path_factory.mktemp("clip") / "clip.mp4", Scene(), moves, TIMES)


@pytest.fixture(scope="module")
def filmed(clip):
    return read_clip(clip)


@pytest.fixture(scope="module")
def step():
    """A servo's step of a second: its pulses, and its angle by the time."""
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    command = st.signals.step(1.4e-3, 1.7e-3, at=0.2, unit="s")
    result = st.simulate(model, command, duration=1.2, output_times=np.linspace(0.0, 1.2, 2401))

    def angle(time):
        return np.interp(time, result.time, result["output_angle"])
    return angle


@pytest.fixture(scope="module")
def servo_film(tmp_path_factory, step):
    """The clip of that step, with a lamp that goes on where it begins, and the recorder's log of it."""
    folder = tmp_path_factory.mktemp("servo")
    scene = Scene(side=100.0, lamp=(375, 10, 12, START))
    film(folder / "clip.mp4", scene, lambda time: step(max(time - START, 0.0)), TIMES)
    rows = np.arange(0.0, 1.2, 0.02)
    (folder / "step.csv").write_text("time_s,pulse_width_us,supply_current_A\n" + "".join(
        f"{t:.3f},{1400 if t < 0.2 else 1700},{0.1:.2f}\n" for t in rows))
    (folder / "step.json").write_text(json.dumps({
        "format": "servotwin-log-1", "motion": "step", "source": "bench, a servo", "conditions": {"voltage_V": 6.0},
        "parameters": {"electronics.frame_period": 0.02}, "recorded": {"servo": "hs-755hb"}}))
    return folder


# --- how well the angle is read


@pytest.mark.long
@pytest.mark.parametrize(("changes", "most"), [
    ({}, 0.3), ({"tilt": 0.0}, 0.3), ({"tilt": 30.0}, 0.3), ({"side": 60.0}, 0.3), ({"side": 30.0}, 0.3),
    ({"noise": 16.0}, 0.3), ({"exposure": 1 / 250}, 0.05), ({"readout": 0.02}, 0.3)],
    ids=lambda value: " ".join(f"{k} {v:.3g}" for k, v in value.items()) or "15 deg, 120 px" if isinstance(value, dict)
    else "")
def test_an_angle_is_read(tmp_path, changes, most):
    scene = replace(Scene(), **changes)
    found = read_clip(film(tmp_path / "clip.mp4", scene, moves, TIMES))
    off = error(found, later=0.5 * scene.exposure + 0.5 * scene.readout)
    assert np.isfinite(off).sum() >= 48
    assert rms(off) < most


@pytest.mark.long
def test_a_servos_angle_is_read(servo_film, step):
    found = read_clip(servo_film / "clip.mp4")
    assert rms(error(found, lambda time: step(np.maximum(time - START, 0.0)))) < 0.3


@pytest.mark.long
def test_another_codec(tmp_path):
    assert rms(error(read_clip(film(tmp_path / "clip.avi", Scene(side=80.0), moves, TIMES, codec="MJPG")))) < 0.3


@pytest.mark.long
def test_the_standard_error_is_what_a_mark_at_rest_scatters(tmp_path):
    """In noise that does not repeat: within a factor of two, as an error of an error may be."""
    found = read_clip(film(tmp_path / "rest.avi", Scene(noise=12.0), lambda time: 0.3, TIMES, codec="MJPG"),
                      instant="none")
    assert 0.5 < np.nanstd(found.angle) / found.angle_std < 2.0


@pytest.mark.long
def test_times_are_those_of_the_file(tmp_path):
    steps = np.random.default_rng(2).choice([1500, 3000, 9000], 50).tolist()
    times = np.concatenate([[0.0], np.cumsum(steps[:-1])]) / 90000
    found = read_clip(with_times(film(tmp_path / "clip.mp4", Scene(side=80.0), moves, times), steps), instant="none")
    np.testing.assert_allclose(found.time, times, atol=1e-9)
    assert rms(error(found)) < 0.3
    slow = read_clip(tmp_path / "clip.mp4", instant="none", slow=4.0)
    np.testing.assert_allclose(slow.time, 4.0 * times, atol=1e-9)


@pytest.mark.long
def test_the_middle_of_the_mark_need_not_be_on_the_axis(tmp_path):
    found = read_clip(film(tmp_path / "clip.mp4", Scene(side=80.0, marks=((0, (0.3, 0.2)),)), moves, TIMES))
    assert rms(error(found)) < 0.3


@pytest.mark.long
def test_signs_and_zeros(clip, filmed):
    flipped, moved = read_clip(clip, flip=True), read_clip(clip, zero=0.2, flip=True)
    np.testing.assert_allclose(flipped.angle, -filmed.angle, atol=1e-12)
    np.testing.assert_allclose(moved.angle, 0.2 - (filmed.angle - filmed.angle[0]), atol=1e-12)
    assert (filmed.angle - filmed.angle[0])[np.searchsorted(TIMES, 0.7)] > 0.6  # counter-clockwise


@pytest.mark.long
def test_clips_of_one_camera_have_one_zero(tmp_path):
    """Wherever the horn was in the first picture: a fit has one offset for all its logs."""
    first, second = (read_clip(film(tmp_path / "clip.mp4", Scene(side=80.0), lambda time, a=a: a + moves(time),
                                    TIMES[:24]), instant="none").angle.mean() for a in (0.1, 1.1))
    assert np.degrees(second - first) == pytest.approx(np.degrees(1.0), abs=0.2)
    assert read_clip(film(tmp_path / "flat.mp4", Scene(side=80.0, tilt=0.0), lambda time: -0.35, TIMES[:6]),
                     instant="none").angle[0] == pytest.approx(0.0, abs=2e-3)  # the plane is turned by 0.35 rad


@pytest.mark.long
def test_turns_are_counted(tmp_path):
    def turning(time):
        return 9.0 * time

    found = read_clip(film(tmp_path / "clip.mp4", Scene(side=60.0, exposure=1 / 250), turning, TIMES), instant="none")
    assert rms(error(found, turning, 1 / 500)) < 0.1
    assert found.angle[-1] > 4.0 * np.pi


@pytest.mark.long
def test_a_mark_on_the_case_gives_the_zero_and_holds_the_camera(tmp_path):
    case = ((1, 5, 5, 50),)
    still = read_clip(film(tmp_path / "still.mp4", Scene(still=case, tilt=0.0), moves, TIMES))
    assert np.degrees(still.angle[0]) == pytest.approx(np.degrees(0.35), abs=0.2)  # how the plane lies in the picture
    alone = read_clip(film(tmp_path / "alone.mp4", Scene(shake=8.0), moves, TIMES))
    held = read_clip(film(tmp_path / "held.mp4", Scene(shake=8.0, still=case), moves, TIMES))
    assert any("does the camera move" in one for one in alone.remarks)
    assert not any("does the camera move" in one for one in held.remarks)
    assert held.facts["camera_moved_px"] > 3.0
    assert rms(error(held)) < min(0.3, 0.5 * rms(error(alone)))


@pytest.mark.long
def test_pictures_without_the_mark_are_gaps(tmp_path):
    def hidden():
        for k, picture in enumerate(pictures(Scene(side=80.0), moves, TIMES)):
            yield np.full_like(picture, 90) if 20 <= k < 25 else picture

    writer = cv2.VideoWriter(str(tmp_path / "clip.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), RATE, Scene().size)
    for picture in hidden():
        writer.write(picture)
    writer.release()
    found = read_clip(tmp_path / "clip.mp4")
    assert np.flatnonzero(np.isnan(found.angle)).tolist() == [20, 21, 22, 23, 24]
    assert found.remarks[0].startswith("the angle is missing in 5 of 50 pictures")
    assert rms(error(found)) < 0.3


# --- the parts


def test_corners_are_sharpened():
    """To a fifth of what the detector leaves, whole pixels, and to less than a tenth of a pixel."""
    scene = Scene(exposure=1e-3)
    picture = cv2.cvtColor(next(pictures(scene, lambda time: 0.4, [0.0])), cv2.COLOR_BGR2GRAY)
    true = corners(scene, 0.4)
    found = sharpened(cv2, picture, np.round(true))
    assert np.abs(found - true).max() < 0.1
    assert sharpened(cv2, np.full((320, 400), 128, np.uint8), true) is None


def test_a_plane_is_found_to_rounding_errors():
    angle = np.linspace(-1.0, 2.0, 12)
    view = np.array([[90.0, 10.0, 200.0], [-12.0, -80.0, 150.0], [0.02, -0.05, 1.0]])
    turns = np.stack([np.stack([np.cos(angle), -np.sin(angle)], -1), np.stack([np.sin(angle), np.cos(angle)], -1)], -2)
    body = SQUARE + np.array([0.4, -0.2])
    plane = fit_plane(mapped(view, np.einsum("nij,kj->nki", turns, body)))
    np.testing.assert_allclose(np.unwrap(plane.angle) - plane.angle[0], angle - angle[0], atol=1e-7)
    assert np.hypot(*plane.offset) == pytest.approx(np.hypot(0.4, 0.2), abs=1e-6)
    assert plane.residual.max() < 1e-5


def test_one_outlier_hardly_moves_the_others():
    angle = np.linspace(0.0, 1.5, 30)
    square = np.exp(1j * angle)[:, None] * (SQUARE[:, 0] + 1j * SQUARE[:, 1]) * 100
    seen = np.stack([square.real + 200, 150 - square.imag], -1)
    seen += np.random.default_rng(0).normal(0.0, 0.03, seen.shape)
    seen[7] += np.array([[9.0, 4.0], [0.0, 0.0], [-5.0, 0.0], [0.0, 7.0]])
    plane = fit_plane(seen)
    off = np.delete(np.unwrap(plane.angle) - angle, 7)
    assert np.degrees(np.ptp(off)) < 0.15
    assert plane.residual[7] > 20.0 * np.median(plane.residual)


def test_squares_turn():
    np.testing.assert_allclose(turned(SQUARE[None]), 0.0, atol=1e-12)


# --- the common instant


@pytest.mark.parametrize("how", [{"instant": "led"}, {"led": (370, 5, 22, 22)}], ids=["found", "pointed at"])
def test_a_led_gives_the_instant_within_half_a_picture(servo_film, how):
    found = read_clip(servo_film / "clip.mp4", **how)
    assert found.instant.kind == "led"
    assert abs(found.instant.time - START) < 0.5 / RATE
    assert found.instant.error == pytest.approx(1.0 / RATE / np.sqrt(12.0))


@pytest.mark.long(but="0.6166666666666667")
@pytest.mark.parametrize("instant", np.linspace(0.6, 0.6 + 1 / RATE, 5))
def test_any_instant_within_a_picture(tmp_path, instant):
    scene = Scene(side=40.0, size=(200, 160), lamp=(180, 5, 10, instant))
    found = read_clip(film(tmp_path / "clip.mp4", scene, lambda time: 0.2, TIMES[:36]), instant="led")
    # a picture's time is the beginning of its exposure, and of the angle it shows the middle is meant
    assert abs(found.instant.time + 0.5 * EXPOSURE - instant) <= 0.5 / RATE


def test_a_jump_is_between_two_pictures(filmed):
    assert 0.4 - 1 / RATE < filmed.instant.time < 0.4 + 1.5 / RATE
    assert filmed.time[0] == -filmed.instant.time


@pytest.mark.long
def test_instants_that_are_not_there(clip, servo_film):
    with pytest.raises(InputError, match="no light goes on"):
        read_clip(clip, instant="led")
    with pytest.raises(InputError, match="within the picture's 400 x 320"):
        read_clip(clip, led=(390, 10, 20, 20))
    with pytest.raises(InputError, match="a time in the clip"):
        read_clip(clip, instant=9.0)
    with pytest.raises(InputError, match="led, jump, none"):
        read_clip(clip, instant="bang")
    with pytest.raises(InputError, match="stands still"):
        jump(TIMES, np.zeros(50), 1e-4)
    with pytest.raises(InputError, match="from the beginning"):
        jump(TIMES, np.linspace(0.0, 3.0, 50), 1e-4)


@pytest.mark.long
def test_two_lights_are_one_too_many(tmp_path):
    def two():
        for k, picture in enumerate(pictures(Scene(side=40.0, size=(200, 160)), lambda time: 0.0, TIMES)):
            picture[:12, :12], picture[:12, -12:] = (250 if k > 15 else 60), (250 if k > 30 else 60)
            yield picture

    writer = cv2.VideoWriter(str(tmp_path / "clip.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), RATE, (200, 160))
    for picture in two():
        writer.write(picture)
    writer.release()
    with pytest.raises(InputError, match="more than one thing"):
        read_clip(tmp_path / "clip.mp4", instant="led")
    assert abs(read_clip(tmp_path / "clip.mp4", led=(188, 0, 12, 12)).instant.time - 30.5 / RATE) < 1e-6


# --- the log


def test_a_log_for_the_fit(servo_film, step, tmp_path):
    """Command and angle on one clock: late by what the sidecar says, and half a picture more or less."""
    found = read_clip(servo_film / "clip.mp4", instant="led")
    write_film_log(found, tmp_path / "filmed.csv", log=servo_film / "step.csv")
    log, = st.identification.read_logs(tmp_path / "filmed.csv")
    assert (log.motion, log.command_kind, log.conditions["angle"]) == ("step", "pulse_width", "video")
    assert log.parameters == {"electronics.frame_period": 0.02}
    assert log.command[np.searchsorted(log.time, [0.1, 0.3])].tolist() == [1.4e-3, 1.7e-3]
    assert log.used("supply_current").sum() == 60
    said = json.loads((tmp_path / "filmed.json").read_text())["recorded"]
    assert said["servo"] == "hs-755hb"
    late = said["video"]["angle_later_by_s"]
    assert late == pytest.approx(0.5 / RATE, abs=1e-6)
    seen = log.used("output_angle")
    assert 30 <= seen.sum() <= 37

    def off(delay):
        return np.degrees(log.measured["output_angle"][seen] - step(np.maximum(log.time[seen] - delay, 0.0)))

    delays = np.linspace(-0.02, 0.08, 201)
    best = delays[np.argmin([rms(off(delay)) for delay in delays])]
    assert -1e-3 <= best <= late + 0.5 / RATE + 0.5 * EXPOSURE
    assert rms(off(best)) < 0.3
    with pytest.raises(OutputExistsError):
        write_film_log(found, tmp_path / "filmed.csv", log=servo_film / "step.csv")


def test_a_first_jump_is_the_first_change_of_the_command(servo_film, step):
    made = film_log(read_clip(servo_film / "clip.mp4", instant="jump"), servo_film / "step.csv")
    rows = [(t, float(a)) for t, a in zip(made.columns["time_s"], made.columns["output_angle_deg"], strict=True)
            if a != ""]
    rest = rows[0][1]
    moved = next(t for t, a in rows if abs(a - rest) > 1.0)
    assert 0.2 < moved < 0.2 + 0.02 + 2.0 / RATE  # never before the command: a fit knows no negative delay


def test_without_pulses_a_row_says_so(servo_film, tmp_path):
    (tmp_path / "gap.csv").write_text("time_s,pulse_width_us\n0,1400\n0.2,1700\n0.5,\n0.8,1700\n1.1,1700\n")
    made = film_log(read_clip(servo_film / "clip.mp4", instant="led"), tmp_path / "gap.csv")
    told = {t: p for t, p in zip(made.columns["time_s"], made.columns["pulse_width_us"], strict=True)}
    assert {p for t, p in told.items() if 0.5 <= t < 0.8} == {""}
    assert {p for t, p in told.items() if 0.2 <= t < 0.5} == {"1700"}


@pytest.mark.long
def test_a_servo_that_turns_the_other_way_is_pointed_out(servo_film):
    for flip, count in ((False, 0), (True, 1)):
        found = read_clip(servo_film / "clip.mp4", instant="led", flip=flip)
        assert len(film_log(found, servo_film / "step.csv").remarks) == count


@pytest.mark.parametrize(("text", "says"), [
    ("time_s,pulse_width_us,output_angle_deg\n0,1,2\n1,1,2\n", "a log without an angle"),
    ("time_s,supply_current_A\n0,1\n1,1\n", "pulse_width_us"),
    ("time_s,pulse_width_us\n0,1500\n0,1500\n", "increasing times"),
    ("time_s,pulse_width_us\n0,1500\n2,1500\n", "never changes"),
    ("time_s,pulse_width_us\n0,1500\n0.001,1600\n0.002,1600\n", "3 or more"),
])
def test_logs_that_do_not_fit(filmed, tmp_path, text, says):
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=says):
        film_log(filmed, tmp_path / "run.csv")


def test_a_broken_log_is_mended_as_at_every_other_door(servo_film, tmp_path):
    text = (servo_film / "step.csv").read_text().splitlines()
    (tmp_path / "step.json").write_bytes((servo_film / "step.json").read_bytes())
    file, found = tmp_path / "step.csv", read_clip(servo_film / "clip.mp4", instant="led")
    file.write_text("\n".join([*text[:5], "rst:0x1 (POWERON_RESET)", *text[5:], "0.9"]))
    made = film_log(found, file)
    assert made.columns == film_log(found, servo_film / "step.csv").columns
    assert any("text in line 6 was left out" in one for one in made.remarks)
    file.write_text("\n".join([*text[:5], text[5][:4], *text[5:], ""]))
    with pytest.raises(InputError, match="--mend torn"):
        film_log(found, file)
    assert film_log(found, file, mend=["torn"]).columns == made.columns


# --- what is no clip of a mark


def spoiled(tmp_path, clip, kind):
    path = tmp_path / "bad.mp4"
    data = clip.read_bytes()
    if kind == "cut in front":
        path.write_bytes(data)
        return cut_in_front(path, 0.6)
    if kind == "cut mkv":
        whole = film(tmp_path / "bad.mkv", Scene(side=60.0), moves, TIMES)
        whole.write_bytes(whole.read_bytes()[:whole.stat().st_size // 2])
        return whole
    if kind == "no mark":
        return film(path, Scene(marks=()), moves, TIMES[:6])
    if kind == "another mark":
        return film(path, Scene(marks=((7, (0.0, 0.0)),)), moves, TIMES[:6])
    if kind == "two marks":
        return film(path, Scene(side=70.0, still=((0, 5, 5, 60),)), moves, TIMES[:6])
    path.write_bytes({"cut": data[:len(data) // 2], "empty": b"", "text": b"time_s,angle\n0,1\n"}.get(kind, b""))
    return tmp_path if kind == "folder" else tmp_path / "none.mp4" if kind == "missing" else path


@pytest.mark.long(but="cut-the clip is cut")
@pytest.mark.parametrize(("kind", "says"), [
    ("missing", "no such file"), ("folder", "cannot be read"), ("empty", "an empty file"),
    ("text", "no video that OpenCV reads"), ("cut", "the clip is cut"), ("cut in front", "the clip is cut"),
    ("cut mkv", "the clip is cut"), ("no mark", r"seen in 0 of 6 pictures', allowed"),
    ("another mark", "seen in 0 of 6 pictures; other marks: 7"), ("two marks", "two in one picture"),
])
def test_one_line_for_what_is_no_clip(tmp_path, clip, kind, says, capfd):
    with pytest.raises(InputError, match=says) as caught:
        read_clip(spoiled(tmp_path, clip, kind))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # OpenCV's own complaints are kept back


def test_without_opencv_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"servotwin\[video\]"):
        read_clip("clip.mp4")
    with pytest.raises(MissingExtraError, match=r"servotwin\[video\]"):
        mark_bytes("svg", side=20e-3)


# --- the mark


@pytest.mark.parametrize("mark", [0, 1])
def test_a_printed_mark_is_found_and_has_its_size(mark, tmp_path):
    (tmp_path / "mark.png").write_bytes(mark_bytes("png", side=20e-3, mark=mark, dpi=300.0))
    page = cv2.imread(str(tmp_path / "mark.png"), cv2.IMREAD_GRAYSCALE)
    at = Finder((mark,), "page").corners(page)[mark]
    sides = np.hypot(*np.diff(np.vstack([at, at[:1]]), axis=0).T)
    np.testing.assert_allclose(sides * 25.4 / 300.0, 20.0, atol=0.02)  # mm
    assert at[1, 0] > at[0, 0] + 200  # upright: the arrow is on the right
    row = page[round(at[:, 1].mean()), round(at[:, 0].max()) + 20:round(at[:, 0].max()) + 60]
    assert row.min() < 50


def test_vector_pages_have_their_size():
    width = 50.0 + 10.0  # mm: the bar and two margins
    svg = mark_bytes("svg", side=20e-3).decode()
    assert float(re.search(r'width="([\d.]+)pt"', svg)[1]) * 25.4 / 72 == pytest.approx(width, abs=0.01)
    pdf = mark_bytes("pdf", side=20e-3)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", pdf)
    assert float(box[1]) * 25.4 / 72 == pytest.approx(width, abs=0.01)
    assert mark_bytes("svg", side=20e-3).decode() == svg


@pytest.mark.parametrize("wrong", [{"side": 1e-3}, {"side": 20e-3, "mark": 50}, {"side": 20e-3, "dpi": 1.0}])
def test_marks_that_cannot_be(wrong):
    with pytest.raises(InputError):
        mark_bytes("png", **wrong)

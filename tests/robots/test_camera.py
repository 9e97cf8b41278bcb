"""Pictures and videos of robots, where something can be drawn without a screen."""

import builtins
import sys

import numpy as np
import pytest

from robots.robots_cases import links
from servotwin.errors import MissingExtraError, OutputError, UnknownNameError
from servotwin.look.opencv import load_opencv
from servotwin.robots import robot_model
from servotwin.robots.camera import Camera, NoDrawingError, Trail, Video, check_drawing, png

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
POSE = np.array([0.3, -0.5])


@pytest.fixture(scope="module", autouse=True)
def drawing():
    try:
        check_drawing()
    except NoDrawingError as error:
        pytest.skip(str(error))


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(links())


def test_a_picture_shows_the_robot_and_its_shadow(model):
    with Camera(model, 96, 64) as camera:
        alone, again = camera.picture(POSE), camera.picture(POSE)
        beside = camera.picture(POSE, POSE + 0.8)
        written = camera.picture(POSE, words="1.00 s", note="pale")
    assert alone.shape == (64, 96, 3)
    assert alone.std() > 5.0
    np.testing.assert_array_equal(alone, again)
    assert np.abs(beside.astype(int) - alone).max() > 20
    assert np.abs(written.astype(int) - alone)[:16].max() > 20


def test_two_cameras_draw_in_turn_as_each_alone(model):
    """The second one left its context current, and the first drew noise."""
    with Camera(model, 96, 64) as first:
        alone = first.picture(POSE)
        with Camera(model, 64, 48) as second:
            second.picture(POSE)
            np.testing.assert_array_equal(first.picture(POSE), alone)
        np.testing.assert_array_equal(first.picture(POSE), alone)


def test_all_of_a_motion_is_in_the_picture(model):
    """The border of no picture shows the robot: without a sky it is black all around."""
    poses = np.linspace([-1.5, 0.0], [1.5, 1.5], 9)
    with Camera(model, 64, 64, poses=poses) as camera:
        for pose in poses:
            picture = camera.picture(pose)
            assert picture.max() > 60
            assert max(picture[[0, -1]].max(), picture[:, [0, -1]].max()) == 0


@pytest.mark.long
def test_a_camera_of_the_model_is_taken_by_its_name():
    arm = robot_model("so101")
    with Camera(arm, 64, 48) as all_of_it, Camera(arm, 64, 48, "side") as own:
        assert (all_of_it.picture(arm.qpos0) != own.picture(arm.qpos0)).any()
    with pytest.raises(UnknownNameError, match="side"):
        Camera(arm, 64, 48, "sid")


def test_a_video_is_one_that_can_be_read(model, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="the extra `video` is not installed")
    path = tmp_path / "robot.webm"
    with Camera(model, 64, 48) as camera, Video(path, 64, 48, 20.0) as video:
        for angle in np.linspace(0.0, 1.0, 8):
            video.add(camera.picture(np.array([angle, 0.0])))
    film = cv2.VideoCapture(str(path))
    assert film.get(cv2.CAP_PROP_FPS) == 20.0
    frames = [film.read()[1] for _ in range(8)]
    assert film.read()[0] is False
    assert frames[0].shape == (48, 64, 3)
    assert np.abs(frames[-1].astype(int) - frames[0]).max() > 20


def test_writing_a_video_says_nothing(tmp_path, capfd):
    pytest.importorskip("cv2", reason="the extra `video` is not installed")
    with Video(tmp_path / "a.webm", 16, 16, 10.0) as video:
        video.add(np.zeros((16, 16, 3), np.uint8))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("name", "said"), [("a.avi", "ends in .webm or .mp4"), ("no/where.webm", "cannot be written")])
def test_a_video_that_cannot_be_written_is_refused(tmp_path, name, said):
    pytest.importorskip("cv2", reason="the extra `video` is not installed")
    with pytest.raises(OutputError, match=said):
        Video(tmp_path / name, 16, 16, 10.0)


def test_a_missing_package_is_named(monkeypatch):
    real = builtins.__import__

    def without(name, *more):
        if name == "cv2":
            raise ImportError(name)
        return real(name, *more)

    monkeypatch.delitem(sys.modules, "cv2", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"servotwin\[video\]"):
        load_opencv()


def test_no_opengl_is_one_line_that_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(NoDrawingError, match="libegl1-mesa libgl1-mesa-dri, or libosmesa6") as caught:
        check_drawing()
    assert "\n" not in str(caught.value)


def test_png_is_lossless():
    from io import BytesIO

    from matplotlib.image import imread

    picture = np.random.default_rng(0).integers(0, 255, (5, 7, 3), dtype=np.uint8)
    np.testing.assert_array_equal((255.0 * imread(BytesIO(png(picture))))[:, :, :3].round(), picture)


def test_lines_in_space_are_drawn_in_their_colours(model):
    line = np.array([[0.0, 0.0, 0.05], [0.15, 0.0, 0.05], [0.15, 0.0, -0.05]])
    with Camera(model, 160, 120) as view:
        plain = view.picture(POSE).astype(float)
        drawn = view.picture(POSE, trails=[Trail(line, (1.0, 0.0, 0.0, 1.0))]).astype(float)
        again = view.picture(POSE).astype(float)
    changed = np.abs(drawn - plain).max(axis=2) > 50.0
    assert 30 < changed.sum() < 4000
    red = drawn[changed]
    assert (red[:, 0] > red[:, 1] + 30.0).mean() > 0.8
    np.testing.assert_array_equal(plain, again)

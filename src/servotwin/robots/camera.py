"""Pictures of a robot, drawn without a screen: the real one, and its ideal shadow beside it."""

from __future__ import annotations

import contextlib
import ctypes.util
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import OutputError, ServotwinError, UnknownNameError
from servotwin.look.opencv import load_opencv, quiet
from servotwin.robots.places import load_mujoco

# --- Videos that a browser plays, written picture by picture with OpenCV ----------------------------------------------

Picture = NDArray[np.uint8]
CODECS = {".webm": ("VP80", "VP90"), ".mp4": ("avc1", "vp09")}
"""By the ending of a file, what browsers play, what is tried first standing first: VP8 is written five times as fast as
VP9, and H.264 not at all by the wheels of OpenCV, whose licence forbids it."""


class Video:
    """A video file; close it, or use it in a `with` statement.

    Parameters
    ----------
    path : Path
        Ends in .webm or .mp4; replaced if it is there.
    width, height : int
        [pixels]
    rate : float
        Pictures a second [Hz]

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    OutputError
        If the file ends otherwise, or OpenCV cannot write it.
    """

    def __init__(self, path: Path, width: int, height: int, rate: float) -> None:
        cv2 = load_opencv()
        if path.suffix.lower() not in CODECS:
            raise OutputError("video", got=str(path), allowed="a name that ends in " + " or ".join(CODECS))
        self.codec = ""
        known = CODECS[path.suffix.lower()]
        for codec in known:
            with quiet():  # it tells on stderr of each codec that it does not have
                self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), float(rate), (width, height))
            if self._writer.isOpened():
                self.codec = codec
                return
            self._writer.release()
        raise OutputError(f"{path} cannot be written (this OpenCV has none of {', '.join(known)})")

    def add(self, picture: Picture) -> None:
        """Write a picture, shape (height, width, 3), red, green, blue."""
        self._writer.write(np.ascontiguousarray(picture[:, :, ::-1]))

    def close(self) -> None:
        """Write what is left."""
        self._writer.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def png(picture: Picture) -> bytes:
    """Return a picture as a PNG file; Pillow, which writes it, comes with matplotlib.

    Examples
    --------
    >>> png(np.zeros((2, 3, 3), np.uint8))[1:4]
    b'PNG'
    """
    from PIL import Image

    with io.BytesIO() as stream:
        Image.fromarray(picture).save(stream, format="png")
        return stream.getvalue()


# --- Pictures of a robot, drawn without a screen: the real one, and its ideal shadow beside it ------------------------

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # by which MuJoCo draws without a screen
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
_OFF = ("disable", "disabled", "off", "false", "0")
_MOST_SHAPES = 20_000
_SHADOW = (0.35, 0.55, 0.75, 0.35)  # red, green, blue, opacity
_AZIMUTH, _ELEVATION = 125.0, -18.0  # degrees, of the view of a robot without a camera of its own
_ROOM = 1.06  # times the distance from which the robot just fits
_LOOKS = 40  # poses by which a robot is kept in the picture
_SIDE = "side"  # of the cameras of a model, the one whose direction is taken first


class Trail(NamedTuple):
    """A line in space: points, shape (n, 3) [m], its colour (red, green, blue, opacity), how wide [pixels]."""

    points: NDArray[np.float64]
    colour: tuple[float, float, float, float]
    width: float = 3.0


class NoDrawingError(ServotwinError):
    """Nothing can be drawn: no OpenGL that works without a screen."""


class Camera:
    """Draws pictures of a robot; close it, or use it in a `with` statement.

    `MUJOCO_GL` says by what MuJoCo draws: "egl", "osmesa" or "glfw". Where it says nothing and there is no screen it is
    EGL, or OSMesa where there is no EGL.

    Parameters
    ----------
    model : MjModel
        Its picture buffer is made large enough.
    width, height : int
        [pixels]
    camera : str, optional
        Of the model; unless given a view of all of the robot, from where its camera "side" is, or its first one.
    poses : ndarray, shape (n, nq), optional
        That this view has to have room for; the one that the model begins with unless given.

    Raises
    ------
    NoDrawingError
        If there is no OpenGL, one line that names what to install.
    UnknownNameError
        If the model has no such camera.
    """

    def __init__(self, model: Any, width: int = 640, height: int = 480, camera: str | None = None,
                 poses: NDArray[np.float64] | None = None) -> None:
        mujoco = load_mujoco()
        self._mujoco, self._model = mujoco, model
        self._width, self._height = width, height
        model.vis.global_.offwidth = max(int(model.vis.global_.offwidth), width)
        model.vis.global_.offheight = max(int(model.vis.global_.offheight), height)
        self._data, self._shadow = mujoco.MjData(model), mujoco.MjData(model)
        self._view = self._view_of(camera, np.atleast_2d(model.qpos0 if poses is None else poses))
        self._option, self._hand = mujoco.MjvOption(), mujoco.MjvPerturb()
        self._scene = mujoco.MjvScene(model, maxgeom=_MOST_SHAPES)
        self._open: list[Callable[[], object]] = []
        try:
            self._gl = _context_class()(width, height)
            self._open.append(self._gl.free)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            self._open.append(self._context.free)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        except NoDrawingError:
            raise
        except Exception as error:  # what a driver raises is not foreseeable
            self.close()
            raise _no_drawing(f"{type(error).__name__}: {error}") from None

    def picture(self, pose: NDArray[np.float64], shadow: NDArray[np.float64] | None = None, *, words: str = "",
                note: str = "", trails: Sequence[Trail] = ()) -> Picture:
        """Return a picture of the robot in a pose, shape (height, width, 3), red, green, blue.

        Parameters
        ----------
        pose : ndarray, shape (nq,)
            MuJoCo's `qpos`.
        shadow : ndarray, shape (nq,), optional
            Another pose, drawn as a transparent shadow.
        words, note : str
            Written at the top and at the bottom, on the left.
        trails : sequence of Trail
            Lines in space.
        """
        mujoco, scene = self._mujoco, self._scene
        self._gl.make_current()  # another camera may have drawn since
        all_of_it = mujoco.mjtCatBit.mjCAT_ALL.value
        self._put(self._data, pose)
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, self._view, all_of_it, scene)
        if shadow is not None:
            first = scene.ngeom
            self._put(self._shadow, shadow)
            mujoco.mjv_addGeoms(self._model, self._shadow, self._option, self._hand,
                                mujoco.mjtCatBit.mjCAT_DYNAMIC.value, scene)
            for k in range(first, scene.ngeom):
                scene.geoms[k].rgba[:] = _SHADOW
                scene.geoms[k].transparent = 1
        for trail in trails:
            self._draw(trail)
        frame = mujoco.MjrRect(0, 0, self._width, self._height)
        mujoco.mjr_render(frame, scene, self._context)
        for place, text in ((mujoco.mjtGridPos.mjGRID_TOPLEFT, words), (mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, note)):
            if text:
                mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, place, frame, text, "", self._context)
        pixels = np.empty((self._height, self._width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, frame, self._context)
        return np.ascontiguousarray(pixels[::-1])

    def _draw(self, trail: Trail) -> None:
        """Add a line to the scene, as far as there is room."""
        mujoco, scene = self._mujoco, self._scene
        line = mujoco.mjtGeom.mjGEOM_LINE
        for a, b in pairwise(np.asarray(trail.points, dtype=np.float64)):
            if scene.ngeom >= scene.maxgeom:
                return
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(geom, line.value, np.zeros(3), np.zeros(3), np.zeros(9),
                                np.array(trail.colour, dtype=np.float32))
            mujoco.mjv_connector(geom, line.value, trail.width, a, b)
            scene.ngeom += 1

    def _view_of(self, name: str | None, poses: NDArray[np.float64]) -> Any:
        """Return where the robot is seen from."""
        mujoco, model, view = self._mujoco, self._model, self._mujoco.MjvCamera()
        names = [model.camera(k).name for k in range(model.ncam)]
        if name is not None:
            if name not in names:
                raise UnknownNameError("camera of the model", name, [known for known in names if known])
            view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, names.index(name)
            return view
        view.azimuth, view.elevation = _AZIMUTH, _ELEVATION
        if names:
            self._put(self._data, poses[0])
            ahead = -self._data.cam_xmat[names.index(_SIDE) if _SIDE in names else 0].reshape(3, 3)[:, 2]
            view.azimuth = np.degrees(np.arctan2(ahead[1], ahead[0]))
            view.elevation = np.degrees(np.arcsin(np.clip(ahead[2], -1.0, 1.0)))
        places, radii = self._balls(poses[::max(len(poses) // _LOOKS, 1)])
        low, high = (places - radii[:, None]).min(axis=0), (places + radii[:, None]).max(axis=0)
        view.lookat[:] = 0.5 * (low + high)
        view.distance = _ROOM * self._distance(view, places - view.lookat, radii)
        return view

    def _distance(self, view: Any, places: NDArray[np.float64], radii: NDArray[np.float64]) -> float:
        """Return how far a view has to be from what it looks at for some balls about it to be in the picture [m]."""
        azimuth, elevation = np.radians([view.azimuth, view.elevation])
        ahead = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        half = np.radians(0.5 * float(self._model.vis.global_.fovy))
        found = 0.0
        for axis, angle in ((np.cross(right, ahead), half),
                            (right, np.arctan(np.tan(half) * self._width / self._height))):
            needed = (np.abs(places @ axis) + radii / np.cos(angle)) / np.tan(angle) - places @ ahead
            found = max(found, float(needed.max()))
        return found

    def _balls(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return centres and radii of balls [m] that hold all parts of the robot in some poses."""
        model, places = self._model, []
        parts = model.geom_rbound > 0.0  # planes have none
        if not parts.any():
            return np.array([model.stat.center]), np.array([model.stat.extent])
        for pose in poses:
            self._put(self._data, pose)
            places.append(self._data.geom_xpos[parts].copy())
        return np.concatenate(places), np.tile(model.geom_rbound[parts], len(poses))

    def _put(self, data: Any, pose: NDArray[np.float64]) -> None:
        data.qpos[:] = pose
        self._mujoco.mj_kinematics(self._model, data)
        self._mujoco.mj_comPos(self._model, data)
        self._mujoco.mj_camlight(self._model, data)
        self._mujoco.mj_tendon(self._model, data)

    def close(self) -> None:
        """Give back what the drawing holds."""
        if self._open:
            self._gl.make_current()  # or another camera's pictures would go
        while self._open:
            self._open.pop()()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def check_drawing() -> None:
    """Raise NoDrawingError unless a picture can be drawn here."""
    mujoco = load_mujoco()
    with contextlib.closing(Camera(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16)):
        pass


def _context_class() -> Any:
    """Return MuJoCo's class of OpenGL contexts for this machine.

    Its own choice falls when it is imported, and is one that needs a screen.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in _OFF:
        raise _no_drawing(f"MUJOCO_GL is {asked}")
    if not sys.platform.startswith("linux"):
        return import_module("mujoco.gl_context").GLContext
    kind = asked if asked in ("egl", "osmesa", "glfw") else ""
    if not kind and any(os.environ.get(name) for name in _DISPLAYS):
        kind = "glfw"
    if not kind:
        found = [kind for kind, library in _LIBRARIES.items() if ctypes.util.find_library(library)]
        if not found:
            raise _no_drawing("neither EGL nor OSMesa is installed")
        kind = found[0]
    with _platform(kind):
        return import_module(f"mujoco.{kind}").GLContext


@contextlib.contextmanager
def _platform(kind: str) -> Iterator[None]:
    """Let PyOpenGL load what a kind of context needs, whatever was said before."""
    name, before = "PYOPENGL_PLATFORM", os.environ.get("PYOPENGL_PLATFORM")
    if kind in _LIBRARIES and "OpenGL" not in sys.modules:
        os.environ[name] = kind
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = before


def _no_drawing(reason: str) -> NoDrawingError:
    return NoDrawingError(f"no picture of the robot can be drawn here ({' '.join(reason.split())}): on Debian, apt "
                          "install libegl1-mesa libgl1-mesa-dri, or libosmesa6 with MUJOCO_GL=osmesa")

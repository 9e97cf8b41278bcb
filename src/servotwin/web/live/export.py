"""What leaves the bench as files: a table of its signals, a servo file, a script that repeats it, its scene."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.parameters.servo_file import servo_text
from servotwin.simulation.result import write_csv
from servotwin.text import file_stem
from servotwin.web.live.replay import replay

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from servotwin.models import Model
    from servotwin.web.live.scene import Scene

    Array = NDArray[np.float64]

KINDS = ("csv", "script", "servo", "scene")
"""Kinds of files."""
STEP = 1e-3  # s
APART = 1e-9  # s: times that are nearer are one
SCRIPT = '''"""{title}: what was done at the bench, once more.

It needs servotwin and nothing else: python {name}
"""

import math

import servotwin as st

SCENE = r\'\'\'
{text}\'\'\'

run = st.web.replay(SCENE)
for name, seen in zip(run.names, run.signals, strict=True):
    print(f"{{name}}: {{math.degrees(seen['output_angle'][-1]):.9f}} deg after {{seen['time'][-1]:.6f}} s")
'''


class File(NamedTuple):
    """A file that a page offers: its name, what it is, and its text."""

    name: str
    type: str
    text: str


def exported(kind: str, scene: Scene, models: tuple[Model, ...], servo: int = 0,
             progress: Callable[[float], object] | None = None) -> File:
    """Return a file.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    scene : Scene
        As it is now.
    models : tuple of Model
        With their numbers of now.
    servo : int
        Of which, for "csv" and "servo".
    progress : callable, optional
        Is told the share that is done.

    Raises
    ------
    InputError
        If there is no such file.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.web.live import SceneServo
    >>> scene = st.web.Scene(servos=(SceneServo(id="hitec-hs-755hb"),), end=0.1)
    >>> exported("csv", scene, ()).text[:20]
    'time_s,command_volta'
    """
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError("export", got=kind, allowed=", ".join(KINDS))
    if isinstance(servo, bool) or not isinstance(servo, int) or not 0 <= servo < len(scene.servos):
        raise InputError("servo of an export", got=servo, allowed=f"a whole number from 0 to {len(scene.servos) - 1}")
    if kind == "servo":
        if scene.servos[servo].mystery is not None:
            raise InputError("servo file of a mystery servo", allowed="none: find out what it is")
        return File(f"{file_stem(models[servo].servo.name)}.toml", "application/toml", servo_text(models[servo].servo))
    if kind == "scene":
        return File("bench.toml", "application/toml", scene.text())
    if kind == "script":
        return File("bench.py", "text/x-python", script(scene))
    return File("bench.csv", "text/csv", _table(scene, servo, progress))


def script(scene: Scene) -> str:
    """Return a Python script that repeats a scene and prints where its servos stand at its end."""
    text = scene.text()
    if "'''" in text:
        raise InputError("script of this bench", got="three quotes in a name", allowed="texts without them")
    title = (scene.name or "A bench").replace("\\", "/").replace('"', "'")
    return SCRIPT.format(title=title, name="bench.py", text=text)


def _table(scene: Scene, servo: int, progress: Callable[[float], object] | None) -> str:
    run = replay(scene, output_step=STEP, switches=False, progress=progress)
    out = io.StringIO()
    write_csv(out, _as_heard(run[servo], run.pulses[servo]), run.units)
    return out.getvalue()


def _as_heard(columns: Mapping[str, Array], pulses: Array) -> dict[str, Array]:
    """Return a table whose times can be told apart in its text, and whose pulses are those of their frames.

    A bench that stands at an edge has not heard its pulse yet; of a log this is the first sample of the new one.
    """
    time = columns["time"]
    keep = np.append(np.diff(time) > APART, True)
    table = {name: values[keep] for name, values in columns.items()}
    sent = pulses[pulses[:, 1] > 0.0]
    if "pulse_width" in table and len(sent):
        frame = np.searchsorted(sent[:, 0], table["time"] + APART, side="right") - 1
        table["pulse_width"] = np.where(frame >= 0, sent[np.maximum(frame, 0), 1], table["pulse_width"])
    return table

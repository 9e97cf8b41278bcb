"""A scene once more, from t = 0 to its end: the numbers of a page, without the page."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.models.outputs import SIGNALS
from servotwin.parameters.servo_file import servo_text
from servotwin.simulation.result import write_csv
from servotwin.text import file_stem
from servotwin.units import is_finite
from servotwin.web.live.live_bench import LiveBench
from servotwin.web.live.scene import Scene, read_scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.models import Model
    Array = NDArray[np.float64]


# --- A scene once more, from t = 0 to its end: the numbers of a page, without the page --------------------------------

_MOST_POINTS = 2e6
_STRETCH = 0.5  # s between two calls of `progress`


@dataclass(frozen=True, eq=False)
class Replayed:
    """The record of a bench.

    Parameters
    ----------
    scene : Scene
    names : tuple of str
        Of the servos.
    signals : tuple of mapping of str to ndarray, shape (n,)
        Of each servo, by name, `time` first (SI).
    pulses : tuple of ndarray, shape (m, 2)
        Edges and widths of the pulses of each servo [s], width 0 of a lost one.
    """

    scene: Scene
    names: tuple[str, ...]
    signals: tuple[Mapping[str, Array], ...]
    pulses: tuple[Array, ...]

    def __getitem__(self, servo: int) -> Mapping[str, Array]:
        """Return the signals of a servo."""
        return self.signals[servo]

    def __len__(self) -> int:
        """Return the number of servos."""
        return len(self.signals)

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each signal."""
        return {name: "s" if name == "time" else SIGNALS[name].unit for one in self.signals for name in one}


def replay(scene: Scene | str, *, output_step: float = 1e-3, switches: bool = True,
           progress: Callable[[float], object] | None = None) -> Replayed:
    r"""Repeat what was done at a bench, and return what its servos did.

    Parameters
    ----------
    scene : Scene or str
        A bench, or the text of one.
    output_step : float
        Distance of the output times [s].
    switches : bool
        Whether the times at which a bridge switches come beside, each twice: just before and just after.
    progress : callable, optional
        Called with the share that is done.

    Raises
    ------
    InputError
        Or one of its kinds, if the scene is not possible.
    SimulationError
        If a servo cannot continue.

    Examples
    --------
    >>> run = replay('format = 1\nend = 0.5\nservo = [{id = "hitec-hs-755hb"}]')
    >>> run.names, float(run[0]["time"][-1])
    (('hitec-hs-755hb',), 0.5)
    """
    read = read_scene(scene) if isinstance(scene, str) else scene
    if not (is_finite(output_step) and output_step > 0.0 and read.end / output_step <= _MOST_POINTS):
        raise InputError("output_step", got=output_step,
                         allowed=f"a positive number [s], {_MOST_POINTS:.0e} points at most")
    bench = LiveBench(read)
    rows: list[list[tuple[float, ...]]] = [[row] for row in bench.rows]
    pulses: list[list[tuple[float, float]]] = [[] for _ in bench.models]
    while not bench.reached(read.end):
        push = bench.advance(min(read.end, bench.time + _STRETCH), 1.0 / output_step, switches=switches)
        for k, one in enumerate(push.servos):
            rows[k] += one.points
            pulses[k] += one.pulses
        if progress is not None:
            progress(bench.time / read.end)
    tables = [dict(zip(names, np.array(own, dtype=np.float64).T, strict=True))
              for names, own in zip(bench.columns, rows, strict=True)]
    return Replayed(read, tuple(model.servo.name for model in bench.models), tuple(tables),
                    tuple(np.array(own, dtype=np.float64).reshape(-1, 2) for own in pulses))


# --- Files of the bench: a table of its signals, a servo file, a script that repeats it, its --------------------------

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
        Called with the share that is done.

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
    """Return a table whose times can be distinguished in its text, and whose pulses are those of their frames.

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

"""The one text of a bench's state: what is saved, what a link carries, and what a script repeats."""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.text import load_toml
from servotwin.web.live.actions import Action, action_of
from servotwin.web.live.rules import checked
from servotwin.web.live.said import SCENE, VIEW
from servotwin.web.live.scene_servo import SceneServo, read_scene_servo
from servotwin.web.live.toml_text import toml_line, toml_value

FORMAT = 1
MOST_SERVOS = 6
LONGEST_TEXT = 16_000_000  # characters
MOST_ACTIONS = 100_000
MOST_VIEW = 4000  # characters
TABLES = ("load", "supply", "control", "view", "lesson")
TOP = ("format", "name", "seed", "frame_rate", "end", "actions", "servo", *TABLES)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A bench: its servos, what hangs on them, and all that was done from t = 0 on.

    Parameters
    ----------
    servos : tuple of SceneServo
        One to six.
    name : str
        For people.
    seed : int
        Of all noise, and of which frames are lost.
    frame_rate : float
        Of the transmitter at the start [Hz].
    end : float
        How far its time went [s].
    load : mapping of str to float
        Of each servo alike, by `LOAD_FIELDS`.
    supply : mapping of str to float
        That all servos share, by `SUPPLY_FIELDS`; empty: each has its own.
    actions : tuple of Action
        In the order of their times.
    control : mapping of str to float
        Of the control circuit that makes the pulses, by `control_circuit.CONTROL_FIELDS`; empty: pulses are exact.
    view : mapping
        What the page alone knows.
    lesson : mapping
        What a lesson says; empty for a bench that is none.

    Examples
    --------
    >>> scene = Scene(servos=(SceneServo(id="hitec-hs-755hb", model="PulseServo"),), seed=3)
    >>> read_scene(scene.text()) == scene, read_fragment(scene.fragment()) == scene
    (True, True)
    """

    servos: tuple[SceneServo, ...]
    name: str = ""
    seed: int = 0
    frame_rate: float = 50.0
    end: float = 0.0
    load: Mapping[str, float] = field(default_factory=dict)
    supply: Mapping[str, float] = field(default_factory=dict)
    actions: tuple[Action, ...] = ()
    control: Mapping[str, float] = field(default_factory=dict)
    view: Mapping[str, Any] = field(default_factory=dict)
    lesson: Mapping[str, Any] = field(default_factory=dict)

    def text(self) -> str:
        """Return the text, in TOML; `read_scene` gives an equal scene."""
        lines = [toml_line("format", FORMAT), *([toml_line("name", self.name)] if self.name else []),
                 toml_line("seed", self.seed), toml_line("frame_rate", self.frame_rate), toml_line("end", self.end)]
        if self.actions:
            lines += ["actions = [", *(f"  {toml_value(action.row())}," for action in self.actions), "]"]
        for servo in self.servos:
            lines += ["", "[[servo]]", *servo.lines()]
        for key in TABLES:
            table = getattr(self, key)
            if table:
                lines += ["", f"[{key}]", *(toml_line(name, value) for name, value in table.items())]
        return "\n".join(lines) + "\n"

    def fragment(self) -> str:
        """Return the text packed for the part of a link after its #."""
        return base64.urlsafe_b64encode(zlib.compress(self.text().encode(), 9)).decode().rstrip("=")


def read_fragment(fragment: str) -> Scene:
    """Return the scene that a link carries.

    Raises
    ------
    InputError
        If it carries none.
    """
    try:
        packed = base64.urlsafe_b64decode(fragment + "=" * (-len(fragment) % 4))
        unpacking = zlib.decompressobj()
        text = unpacking.decompress(packed, LONGEST_TEXT)
        if unpacking.unconsumed_tail or not unpacking.eof:
            raise InputError("link", got="a text that is too long or cut", allowed="a whole link of a bench")
        return read_scene(text.decode())
    except (binascii.Error, zlib.error, UnicodeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("link", got="something that does not unpack", allowed="a whole link of a bench") from None


def read_scene(text: str) -> Scene:
    """Return the scene that a text describes.

    Raises
    ------
    InputError
        Or one of its kinds: in one line, what is wrong, got and allowed.
    """
    if len(text) > LONGEST_TEXT:
        raise InputError("scene", got=f"{len(text)} characters", allowed=f"at most {LONGEST_TEXT}")
    content = _content(text)
    for key in content:
        if key not in TOP:
            raise UnknownNameError("key of a scene", key, TOP)
    if content.get("format") != FORMAT:
        raise InputError("format of a scene", got=content.get("format"), allowed=f"{FORMAT}")
    servos = content.get("servo")
    if not isinstance(servos, list) or not 1 <= len(servos) <= MOST_SERVOS:
        raise InputError("servos of a scene", got=servos if not isinstance(servos, list) else len(servos),
                         allowed=f"1 to {MOST_SERVOS} tables [[servo]]")
    actions = content.get("actions", [])
    if not isinstance(actions, list) or len(actions) > MOST_ACTIONS:
        raise InputError("actions of a scene", got=len(actions) if isinstance(actions, list) else actions,
                         allowed=f"a list of at most {MOST_ACTIONS}")
    done = tuple(action_of(row, len(servos)) for row in actions)
    if any(b.time < a.time for a, b in pairwise(done)):
        raise InputError("actions of a scene", got="times that go back", allowed="the order of their times")
    own = {key: checked(rule, content[key]) if key in content else rule.get("usual", {})
           for key, rule in SCENE.items()}
    return Scene(servos=tuple(read_scene_servo(servo) for servo in servos), actions=done, view=_view(content),
                 lesson=_lesson(content), **own)


def checked_view(view: Any) -> dict[str, Any]:
    """Return what a page wants to be remembered of itself.

    Raises
    ------
    InputError
        If it is no table of words, numbers and truths, or too much.

    Examples
    --------
    >>> checked_view({"window": 5.0})
    {'window': 5.0}
    """
    found: dict[str, Any] = checked(VIEW, view)
    if sum(len(name) + len(str(one)) for name, one in found.items()) > MOST_VIEW:
        raise InputError("view", got="more than that", allowed=f"{MOST_VIEW} characters in all")
    return found


def _content(text: str) -> dict[str, Any]:
    try:
        return load_toml(text.removeprefix("\ufeff"))
    except ValueError as error:
        raise InputError(f"scene: not valid TOML: {error}") from None


def _table(content: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = content.get(key, {})
    if not isinstance(value, dict):
        raise InputError(f"{key} of a scene", got=value, allowed=f"a table [{key}]")
    return value


def _lesson(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table of texts and lists of them; what a lesson needs, `read_lesson` looks at."""
    found = _table(content, "lesson")
    listed = [one for value in found.values() for one in (value if isinstance(value, list) else [value])]
    if not all(isinstance(one, str) for one in listed):
        raise InputError("lesson of a scene", got="other values", allowed="texts and lists of texts")
    return found


def _view(content: Mapping[str, Any]) -> dict[str, Any]:
    return checked_view(_table(content, "view"))

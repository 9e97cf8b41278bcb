"""The one text of a bench's state: what is saved, what a link carries, and what a script repeats."""

from __future__ import annotations

import base64
import binascii
import json
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from servotwin import models
from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.parameters import REGISTER_FAMILIES, load_servo
from servotwin.parameters.catalog import catalog_names
from servotwin.parameters.servo_file import read_servo_text
from servotwin.text import load_toml
from servotwin.units import is_finite
from servotwin.web.live.actions import Action, action_of
from servotwin.web.live.rules import SCENE, SERVO, SOURCES, SUPPLY_FIELDS, VIEW, checked

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo


# --- TOML of plain values on one line each: what a scene is written in ------------------------------------------------

def toml_value(value: Any) -> str:
    """Return a plain value as TOML: words, numbers, truths, lists, and mappings as inline tables.

    Raises
    ------
    InputError
        If it is something else, or a number is not finite.

    Examples
    --------
    >>> toml_value([0.5, "hold", {"load.inertia": 1e-3, "on": True}])
    '[0.5, "hold", {"load.inertia" = 0.001, on = true}]'
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float) and math.isfinite(value):
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    raise InputError("value of a scene", got=value, allowed="words, finite numbers, true, false, lists and tables")


def toml_line(key: str, value: Any) -> str:
    r"""Return `key = value`, a text of several lines as one between three quotes.

    Examples
    --------
    >>> toml_line("seed", 3)
    'seed = 3'
    """
    if isinstance(value, str) and "\n" in value:
        inner = "\n".join(_text(line)[1:-1] for line in value.split("\n"))
        return f'{_key(key)} = """\n{inner}"""'
    return f"{_key(key)} = {toml_value(value)}"


def _text(value: str) -> str:
    """Return a basic string; what is no Unicode stands as a question mark."""
    clean = value.encode("utf-8", "replace").decode()
    return json.dumps(clean, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: str) -> str:
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if plain else _text(key)


# --- A servo of a scene -----------------------------------------------------------------------------------------------

SERVO_MODELS = tuple(kind.__name__ for name, kind in models.MODELS.items() if not name.endswith("motor"))
"""Fidelities that a bench can hold."""


@dataclass(frozen=True, kw_only=True)
class SceneServo:
    """A servo of a scene.

    Parameters
    ----------
    id : str, optional
        Of the catalog.
    file : str, optional
        The whole text of a servo file instead.
    mystery : int, optional
        The seed of a servo whose numbers are hidden instead.
    model : str
        The name of its fidelity, of `SERVO_MODELS`; the one that stands for the servo if empty.
    parameters : mapping
        Numbers and words that are others from the start, by dotted name (SI).
    registers : mapping of str to int
        Of a bus servo, written before the start.
    """

    id: str | None = None
    file: str | None = None
    mystery: int | None = None
    model: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    registers: Mapping[str, int] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """Return its lines in a scene."""
        return [toml_line(name, getattr(self, name)) for name in SERVO["fields"]
                if getattr(self, name) is not None and getattr(self, name) not in ("", {})]

    def servo(self) -> Servo:
        """Return the servo as it is at the start.

        Raises
        ------
        InputError
            Or one of its kinds, if there is none, or a value is not possible.

        Examples
        --------
        >>> SceneServo(id="feetech-sts3215-12v", registers={"P_Coefficient": 8}).servo().name
        'feetech-sts3215-12v'
        """
        servo = self._source()
        if self.registers:
            servo = with_registers(servo, self.registers)
        return servo.replace(self.parameters) if self.parameters else servo

    def built(self) -> Model:
        """Return the model of the servo.

        Raises
        ------
        InputError
            Or one of its kinds, as of `servo`, or if the servo lacks what the model requires.
        """
        servo = self.servo()
        if not self.model:
            return models.default_model(servo)
        return model_named(self.model)(servo)

    def _source(self) -> Servo:
        if self.file is not None:
            return read_servo_text(self.file, "servo file")
        if self.mystery is not None:
            from servotwin.web.lessons.mystery import mystery_servo

            return mystery_servo(self.mystery)
        if self.id not in catalog_names():  # never a path: a page reaches no file
            raise UnknownNameError("servo", str(self.id), catalog_names())
        return load_servo(str(self.id))


def model_named(name: str) -> type[Model]:
    """Return a fidelity by the name of its class.

    Examples
    --------
    >>> model_named("PulseServo").__name__
    'PulseServo'
    """
    kind: type[Model] = getattr(models, name)
    return kind


def family_of(servo: Servo) -> str | None:
    """Return the name of the registers that a servo has, of `REGISTER_FAMILIES`; None without.

    Examples
    --------
    >>> family_of(load_servo("feetech-sts3215-12v")), family_of(load_servo("hitec-hs-755hb"))
    ('feetech-sts', None)
    """
    from servotwin.parameters.registers.table import family_label

    label = family_label(servo)
    return None if label is None else label.lower().replace(" ", "-")


def with_registers(servo: Servo, registers: Mapping[str, int]) -> Servo:
    """Return a servo with raw values written into its registers.

    Raises
    ------
    ParameterError, UnknownNameError
        If it has none, or not these.
    """
    family = family_of(servo)
    if family is None:
        raise ParameterError(f"registers of {servo.name}", got=", ".join(registers), allowed="none: it is no bus servo")
    return REGISTER_FAMILIES[family](registers, servo=servo)


def read_scene_servo(table: Any) -> SceneServo:
    """Return the servo that a table of a scene describes.

    Raises
    ------
    InputError
        Or one of its kinds, if it describes none.
    """
    found: dict[str, Any] = checked(SERVO, table)
    if sum(key in found for key in SOURCES) != 1:
        raise InputError("servo of a scene", got=", ".join(key for key in SOURCES if key in found) or "none of them",
                         allowed="one of id, file, mystery")
    if found["model"] not in ("", *SERVO_MODELS):
        raise UnknownNameError("model", found["model"], SERVO_MODELS)
    return SceneServo(**found)


# --- The one text of a bench's state: what is saved, what a link carries, and what a script repeats -------------------

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
        Values for the page alone.
    lesson : mapping
        Texts of a lesson; empty for a bench that is none.

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
    return Scene(servos=tuple(read_scene_servo(servo) for servo in servos), actions=done,
                 view=checked_view(_table(content, "view")), lesson=_lesson(content), **own)


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


# --- Which servos stand on the bench, as a page asks for them: of the catalog, or kept as they are --------------------

def with_servos(scene: Scene, asked: Any, supply: Any = None) -> Scene:
    """Return a bench with other servos, which begins anew; load and transmitter stay.

    Parameters
    ----------
    scene : Scene
        As it is.
    asked : list of mapping
        Of each servo "id", a name of the catalog, or "keep", its number on the bench; and its "model".
    supply : mapping, optional
        Numbers of a supply that all share (SI), by `SUPPLY_FIELDS`.

    Raises
    ------
    InputError
        If that asks for nothing that can be.

    Examples
    --------
    >>> scene = Scene(servos=(SceneServo(mystery=3),), load={"inertia": 1e-3})
    >>> new = with_servos(scene, [{"keep": 0, "model": "PulseServo"}, {"id": "hitec-hs-755hb"}])
    >>> [servo.mystery for servo in new.servos], new.load
    ([3, None], {'inertia': 0.001})
    """
    if not isinstance(asked, list) or not 1 <= len(asked) <= MOST_SERVOS:
        raise InputError("servos", got=len(asked) if isinstance(asked, list) else asked,
                         allowed=f"a list of 1 to {MOST_SERVOS}")
    if supply is not None and not (isinstance(supply, Mapping) and set(supply) <= set(SUPPLY_FIELDS)):
        raise InputError("supply", got=supply, allowed=f"a table of {', '.join(SUPPLY_FIELDS)}")
    servos = tuple(_one(scene, one) for one in asked)
    return replace(scene, servos=servos, supply=dict(supply or {}), name="", end=0.0, actions=(), control={}, lesson={})


def _one(scene: Scene, asked: Any) -> SceneServo:
    if not isinstance(asked, Mapping) or "keep" not in asked:
        return read_scene_servo(asked)
    k, model = asked["keep"], asked.get("model", "")
    if isinstance(k, bool) or not isinstance(k, int) or not 0 <= k < len(scene.servos):
        raise InputError("servo to keep", got=k, allowed=f"a whole number from 0 to {len(scene.servos) - 1}")
    read_scene_servo({"id": "", "model": model})
    return replace(scene.servos[k], model=model)


# --- A bench with a servo that was fitted, beside or instead of the one that the fit began with -----------------------

HOW = ("beside", "instead")
"""Ways to take a servo over."""
_FIELDS = {"load.pendulum.mass": "mass", "load.pendulum.length": "arm", "load.pendulum.hanging_angle": "hanging_angle"}


def taken_over(scene: Scene, models: Sequence[Model], load: Mapping[str, float], frame_rate: float, file: str,
               model: str, servo: int, how: str) -> Scene:
    """Return a bench at its beginning with one servo more, or another one; all else is as it is now.

    Parameters
    ----------
    scene : Scene
        As it is now.
    models : sequence of Model
        With their numbers of now.
    load : mapping
        Changed numbers of loads, by dotted name (SI).
    frame_rate : float
        Of now [Hz].
    file : str
        The text of the servo file.
    model : str
        Its fidelity.
    servo : int
        The servo that the fit began with.
    how : str
        Of `HOW`.

    Raises
    ------
    InputError
        If there is no room for it.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.parameters.servo_file import servo_text
    >>> scene, servo = st.web.Scene(servos=(SceneServo(id="hitec-hs-755hb"),)), st.load_servo("hitec-hs-755hb")
    >>> made = taken_over(scene, [st.PulseServo(servo)], {"load.inertia": 1e-3}, 50.0, servo_text(servo), "PulseServo",
    ...                   0, "beside")
    >>> len(made.servos), made.load["inertia"], made.servos[1].servo() == servo
    (2, 0.001, True)
    """
    if how == "beside" and len(scene.servos) >= MOST_SERVOS:
        raise InputError("servos", got=f"{len(scene.servos)} and one more", allowed=f"at most {MOST_SERVOS}; take it "
                         "over instead of another")
    new = SceneServo(file=file, model=model)
    kept = [_as_now(one, now) for one, now in zip(scene.servos, models, strict=True)]
    if how == "beside" or servo >= len(kept):
        kept.append(new)
    else:
        kept[servo] = new
    supply = {key: value for key in SUPPLY_FIELDS if is_finite(value := models[0].servo.get(f"supply.{key}"))}
    changed = {_FIELDS.get(name, name.removeprefix("load.")): value for name, value in load.items()}
    command = next((action.value for action in reversed(scene.actions)
                    if action.kind == "command" and action.servo is None and action.time <= scene.end), None)
    return replace(scene, servos=tuple(kept), load={**scene.load, **changed}, frame_rate=frame_rate, end=0.0,
                   supply=supply if scene.supply else {}, lesson={},
                   actions=() if command is None else (Action(0.0, "command", command),))


def _as_now(servo: SceneServo, now: Model) -> SceneServo:
    """Return a servo of a scene that begins with its numbers of now."""
    before = servo.servo()
    changed: dict[str, Any] = {}
    for name in dict.fromkeys((*before.names(), *now.servo.names())):
        value = now.servo.get(name)
        if value != before.get(name) and (is_finite(value) or isinstance(value, str)):
            changed[name] = value
    return replace(servo, parameters={**servo.parameters, **changed}) if changed else servo

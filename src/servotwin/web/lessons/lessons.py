"""The lessons: each a text that sets the bench up, says what to look at, and asks one question."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.web.lessons.mystery import SEEDS
from servotwin.web.live.scene import Scene, SceneServo, read_scene

if TYPE_CHECKING:
    from servotwin.web.live.scene import Scene

_ORDER = ("deadband", "droop", "frames", "brake-or-coast", "vibration", "brown-out", "play", "p-gain")
_TEXTS = ("title", "question", "answer")
SENTENCES = 3
"""How many a lesson says of what to look at."""


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """A lesson.

    Parameters
    ----------
    name : str
        As in links.
    scene : Scene
        The bench that it sets up.
    title : str
    look : tuple of str
        Three sentences: what to look at.
    question, answer : str
    """

    name: str
    scene: Scene
    title: str
    look: tuple[str, ...]
    question: str
    answer: str

    def listed(self) -> dict[str, Any]:
        """Return what a page lists of it."""
        return {"name": self.name, "title": self.title, "look": list(self.look), "question": self.question,
                "answer": self.answer}


@cache
def lessons() -> tuple[Lesson, ...]:
    """Return all lessons, in their order.

    Examples
    --------
    >>> [lesson.name for lesson in lessons()][:2]
    ['deadband', 'droop']
    """
    folder = resources.files("servotwin.web.lessons")
    return tuple(read_lesson(name, folder.joinpath(f"{name}.toml").read_text("utf-8")) for name in _ORDER)


def lesson(name: str) -> Lesson:
    """Return a lesson by its name.

    Raises
    ------
    UnknownNameError
        If there is none; the nearest are suggested.

    Examples
    --------
    >>> lesson("deadband").title
    'A servo that is content'
    """
    for one in lessons():
        if one.name == name:
            return one
    raise UnknownNameError("lesson", name, _ORDER)


def read_lesson(name: str, text: str) -> Lesson:
    """Return the lesson that a text describes: a scene with a table [lesson].

    Raises
    ------
    InputError
        If it is none.
    """
    scene = read_scene(text)
    table = scene.lesson
    look = table.get("look")
    if not isinstance(look, list) or len(look) != SENTENCES or not all(isinstance(one, str) for one in look):
        raise InputError(f"look of lesson {name}", got=look, allowed="three sentences")
    for key in _TEXTS:
        if not isinstance(table.get(key), str):
            raise InputError(f"{key} of lesson {name}", got=table.get(key), allowed="a text")
    return Lesson(name=name, scene=scene, look=tuple(look), **{key: table[key] for key in _TEXTS})



def mystery_scene(seed: object) -> Scene:
    """Return a bench with the servo behind a seed.

    Raises
    ------
    InputError
        If it is no seed.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
        raise InputError("seed of a mystery servo", got=seed, allowed=f"a whole number from 0 to {SEEDS}")
    return Scene(servos=(SceneServo(mystery=seed, model="PulseServo"),), name=f"Mystery servo {seed}")

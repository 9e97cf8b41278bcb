"""A servo of a scene: where its numbers come from, which model computes it, and what was changed from the start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from servotwin import models
from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.parameters import REGISTER_FAMILIES, load_servo
from servotwin.parameters.catalog import catalog_names
from servotwin.parameters.servo_file import read_servo_text
from servotwin.web.live.rules import checked
from servotwin.web.live.said import SERVO, SOURCES
from servotwin.web.live.toml_text import toml_line

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo

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

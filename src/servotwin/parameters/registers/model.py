"""A model of servo within its family: what its registers hold when it is new, and the page that says so."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from servotwin.parameters.registers.register import Register
from servotwin.parameters.servo import Servo


@dataclass(frozen=True, kw_only=True)
class RegisterModel:
    """What differs between models of a family.

    Parameters
    ----------
    name : str
        As its maker writes it, such as ``"XL330-M288"``.
    number : int
        That it answers with.
    document : str
        Where its registers are described: document and section. Empty where none was seen: all is assumed then.
    page : str
        Address of that page, for people.
    values : mapping of str to int
        What its registers hold when it is new, where that is not what most of the family hold.
    ranges : mapping of str to tuple of int
        Lowest and highest value of registers, where these are not the family's.
    units : mapping of str to str
        Of a raw step of registers, where these are not the family's.
    lacks : frozenset of str
        Registers of the family that it does not have.
    elsewhere : mapping of str to str
        Document and section of single registers whose value the page does not print.
    assumed : frozenset of str
        Registers whose value no page that was seen prints.
    """

    name: str
    number: int
    document: str = ""
    page: str = ""
    values: Mapping[str, int] = field(default_factory=dict)
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    lacks: frozenset[str] = frozenset()
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    assumed: frozenset[str] = frozenset()

    @property
    def series(self) -> str:
        """The first word of the name: XL330 of an XL330-M288."""
        return self.name.partition("-")[0]

    def registers(self, common: Mapping[str, Register]) -> dict[str, Register]:
        """Return the registers of the model, out of those of its family."""
        made = {}
        for name, register in common.items():
            if name in self.lacks:
                continue
            lower, upper = self.ranges.get(name, (register.lower, register.upper))
            made[name] = replace(register, factory=self.values.get(name, register.factory), lower=lower, upper=upper,
                                 unit=self.units.get(name, register.unit))
        return made

    def unseen(self, common: Mapping[str, Register]) -> frozenset[str]:
        """Return the registers whose value is assumed."""
        names = frozenset(self.registers(common))
        return self.assumed & names if self.document else names


M = TypeVar("M", bound=RegisterModel)


def model_for(models: Sequence[M], servo: Servo, number: int, common: Mapping[str, Register]) -> M:
    """Return the model that a servo is of, by its number, else by its name or title.

    Of a servo that tells its series alone, such as ``"xl330"``, it is the first of the series, and what differs within
    the series is assumed; of one that tells nothing the first of all, and everything is.

    Parameters
    ----------
    models : sequence of RegisterModel
    servo : Servo
    number : int
        Model_Number, 0 where it is not known.
    common : mapping of str to Register
        Registers of the family.
    """
    told = [model for model in models if number and model.number == number]
    text = re.sub(r"[\s_]+", "-", f"{servo.name}|{servo.title}".lower())  # "XM430 W210" is an XM430-W210
    named = [model for model in told or models if _told(model.name.partition("(")[0], text)]
    if named:
        return max(named, key=lambda model: len(model.name))
    alike = told or [model for model in models if _told(model.series, text)]
    return _any_of(alike, common) if alike else replace(models[0], document="", page="")


def _told(word: str, text: str) -> bool:
    return re.search(rf"(?<![a-z0-9]){re.escape(word.lower())}(?![0-9])", text) is not None


def _any_of(models: Sequence[M], common: Mapping[str, Register]) -> M:
    """Return the first of models, with what differs between them as assumed."""
    first, *others = models
    if not others:
        return first
    own = first.registers(common)
    differ = {name for other in others for name, register in other.registers(common).items()
              if name in own and register.factory != own[name].factory}
    name = first.name if len({model.series for model in models}) > 1 else first.series
    return replace(first, name=name, assumed=first.assumed | differ)

"""A servo as an FMU: a component for co-simulation that tools of FMI 2.0 or 3.0 take."""

from __future__ import annotations

import hashlib
import warnings
import zipfile
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError
from servotwin.export.c_code import c
from servotwin.export.c_writing import features_of_model, signals_of_model, wiring_of
from servotwin.export.fmu_binary import binaries
from servotwin.export.fmu_model import model_header
from servotwin.export.fmu_variables import (
    TIME,
    Variable,
    beginning_of,
    inputs_of,
    numbers_of,
    parameters_of,
    signals_of,
)
from servotwin.export.fmu_xml import build_description, description
from servotwin.loads import as_load
from servotwin.models.engine.memory import ACCURACY
from servotwin.parameters.output_file import write_file
from servotwin.text import shown

if TYPE_CHECKING:
    from servotwin.loads import Load, Part
    from servotwin.models import Model

_PERIOD = "electronics.frame_period"
_STEP = 1e-3  # s: what tools begin with
_TEXTS = {"2.0": ("fmi2.c", "fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
          "3.0": ("fmi3.c", "fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")}
_WHEN = (1980, 1, 1, 0, 0, 0)  # of what is in the archive: the same FMU has the same bytes


@dataclass(frozen=True)
class Fmu:
    """A servo as an FMU.

    Attributes
    ----------
    name : str
        The model identifier.
    version : str
        Of FMI.
    variables : tuple of Variable
    contents : dict of str to bytes
        Files by their paths in it.
    """

    name: str
    version: str
    variables: tuple[Variable, ...]
    contents: dict[str, bytes]

    def write(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the archive, and return its path.

        Raises
        ------
        InputError
            Or one of its kinds, if the path cannot be written, or a file is there and `overwrite` is not given.
        """
        archive = BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as whole:
            for name, content in self.contents.items():
                whole.writestr(zipfile.ZipInfo(name, _WHEN), content, zipfile.ZIP_DEFLATED)
        write_file(Path(path), archive.getvalue(), overwrite=overwrite)
        return Path(path)


def fmu(model: Model, load: Load | Part | None = None, *, fmi: str = "2.0", name: str | None = None,
        accuracy: float = ACCURACY, sources: bool = False) -> Fmu:
    """Return a servo as an FMU for co-simulation.

    Inputs are the command, a pulse width [s] or a goal [rad], and a torque at the shaft [N m]; both are held over a
    communication step. Outputs are all signals of the model. Parameters are those of the servo file that are numbers,
    where the shaft rests at first, and when frames begin; they may be set before initialization is over. A parameter
    that would ask for code that this servo has no use for is left out, as is what the file does not give.

    Parameters
    ----------
    model : Model
        As of `c`.
    load : Load, optional
        What hangs on the shaft.
    fmi : {"2.0", "3.0"}
    name : str, optional
        The model identifier; that of the servo unless given.
    accuracy : float
        What angles may be off by where motions are integrated [rad].
    sources : bool
        Whether it has sources alone, which a tool compiles.

    Raises
    ------
    InputError
        If there is no C for the model or the load, no such version, or no compiler.

    Examples
    --------
    >>> import servotwin as st
    >>> made = fmu(st.PulseServo(st.load_servo("hitec-hs-755hb")), fmi="3.0", sources=True)
    >>> [each.name for each in made.variables][:4]
    ['time', 'pulse_width', 'external_torque', 'start.output_angle']
    """
    if fmi not in _TEXTS:
        raise InputError("export fmu: fmi", got=fmi, allowed=" or ".join(_TEXTS))
    code = c(model, load, name=name, accuracy=accuracy, parameters=True)
    variables = tuple(_variables(model, as_load(load)))
    token = _token(code.header, code.source, repr(variables))
    texts = {f"{code.name}.h": code.header, f"{code.name}.c": code.source,
             "model.h": model_header(code.name, token, variables, frames=_frames(model)),
             **{each: _text(each) for each in ("component.h", "component.c", *_TEXTS[fmi])}}
    compiled = [each for each in texts if each.endswith(".c")]
    title = f"{shown(model.servo.name)} as a {type(model).__name__}"
    contents = {"modelDescription.xml": description(fmi, name=code.name, title=title, token=token, variables=variables,
                                                    sources=compiled, step=_STEP)}
    contents |= {f"sources/{each}": text.encode() for each, text in texts.items()}
    if fmi == "3.0":
        contents["sources/buildDescription.xml"] = build_description(code.name, compiled)
    contents["documentation/licenses/fmi-headers.txt"] = _text("LICENSE.txt").encode()
    if not sources:
        contents |= binaries(fmi, code.name, texts, compiled)
    return Fmu(code.name, fmi, variables, contents)


def _variables(model: Any, load: Load) -> list[Variable]:
    """Return the variables of a servo, in the order of its description."""
    numbers, wiring, frames = _tunable(model, load), wiring_of(model), _frames(model) != "0.0"
    if frames and _PERIOD in model.optional:
        numbers.setdefault(_PERIOD, float(model.frame_period))
    middle = min(max(0.0, wiring.lower), wiring.upper)
    return [Variable("time", TIME, "independent", "s", "time of the simulation"),
            *inputs_of(wiring.per_angle == 1.0, wiring.per_angle * middle + wiring.at_zero, wiring.low, wiring.high),
            *beginning_of(middle, frames), *signals_of(signals_of_model(model, load)), *parameters_of(numbers)]


def _tunable(model: Any, load: Load) -> dict[str, float]:
    """Return the numbers of a model that its code follows whatever they are set to."""
    flags, found = features_of_model(model, load), {}
    for name, value in numbers_of(model).items():
        for other in (1.1 * value, 0.9 * value) if value else (1e-3, 1e-6):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # what is only tried is nobody's word
                    asked = features_of_model(type(model)(model.servo.replace({name: other})), load)
            except InputError:
                continue
            if not asked & ~flags:
                found[name] = value
            break
    return found


def _frames(model: Any) -> str:
    """Return the frame period of a model in C."""
    if model.chip() is not None:
        return "(s)->numbers.chip.frame_period"
    return "(s)->program.T_f" if model.firmware() is not None and not model.takes_goals else "0.0"


def _token(*texts: str) -> str:
    """Return a token that is another one where anything is."""
    made = hashlib.sha256("\0".join(texts).encode()).hexdigest()
    return "{" + "-".join((made[:8], made[8:12], made[12:16], made[16:20], made[20:32])) + "}"


def _text(name: str) -> str:
    return files("servotwin.export").joinpath("fmi", name).read_text(encoding="utf-8")


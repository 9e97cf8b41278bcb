"""A servo as an FMU: a component for co-simulation that tools of FMI 2.0 or 3.0 take."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import re
import subprocess
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree as Xml

from servotwin import __version__
from servotwin.errors import InputError
from servotwin.export.c_code import c
from servotwin.export.c_writing import features_of_model, signals_of_model, wiring_of
from servotwin.loads import as_load
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.terms.given import field_of
from servotwin.parameters.groups import AT_LEAST_ONE, FRACTION, GROUPS, NOT_NEGATIVE, POSITIVE
from servotwin.parameters.output_file import write_file
from servotwin.simulation.compile.finding import compilers
from servotwin.text import shown
from servotwin.units import si_unit

if TYPE_CHECKING:
    from servotwin.loads import Load, Part
    from servotwin.models import Model


# --- The variables of an FMU: what a co-simulation sets and reads of a servo, with units, bounds and ------------------

TIME, COMMAND, TORQUE, ANGLE, FRAMES_BEGIN, FIRST_SIGNAL, FIRST_PARAMETER = 0, 1, 2, 3, 4, 10, 100
_BOUNDS = {POSITIVE: (0.0, math.inf, True), NOT_NEGATIVE: (0.0, math.inf, False), AT_LEAST_ONE: (1.0, math.inf, False),
           FRACTION: (0.0, 1.0, False)}
_BASE: dict[str, dict[str, int]] = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "K": {"K": 1}, "rad": {"rad": 1}, "1": {},
    "Hz": {"s": -1}, "N": {"kg": 1, "m": 1, "s": -2}, "J": {"kg": 1, "m": 2, "s": -2}, "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2}}
_FACTOR = re.compile(r"([A-Za-z]+|1)(\d*)")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    Parameters
    ----------
    name : str
    reference : int
        FMI's value reference.
    causality : {"independent", "input", "output", "parameter"}
    unit, meaning : str
    start : float or None
        None of what is computed.
    low, high : float
        Bounds of what may be set; infinite where there are none.
    is_open : bool
        Whether the lower one is excluded.
    said : str
        Bounds in words, where numbers do not tell them.
    """

    name: str
    reference: int
    causality: str
    unit: str
    meaning: str
    start: float | None = None
    low: float = -math.inf
    high: float = math.inf
    is_open: bool = False
    said: str = ""

    @property
    def allowed(self) -> str:
        """The bounds in words."""
        if self.said:
            return self.said
        if self.low == -math.inf and self.high == math.inf:
            return "a finite number"
        if self.high == math.inf:
            return f"{'more than' if self.is_open else 'at least'} {self.low:g}"
        return f"from {self.low:g} to {self.high:g}"


def inputs_of(goals: bool, command: float, low: float, high: float) -> tuple[Variable, Variable]:
    """Return command and torque, which are held over a step."""
    name, unit = ("command_angle", "rad") if goals else ("pulse_width", "s")
    meaning = "goal that the servo is told" if goals else "width of the pulses that the servo is told"
    said = "" if goals else "a width of more than 0 and less than a frame [s], from the first step on"
    return (Variable(name, COMMAND, "input", unit, meaning, command, low, high, said=said),
            Variable("external_torque", TORQUE, "input", "N m",
                     "torque beside that of the load; positive pushes towards smaller angles", 0.0))


def beginning_of(angle: float, frames: bool) -> Iterator[Variable]:
    """Yield where the servo rests at first, and when its first pulse comes where it has frames."""
    yield Variable("start.output_angle", ANGLE, "parameter", "rad", "where the shaft rests at first", angle)
    if frames:
        yield Variable("start.frames_begin", FRAMES_BEGIN, "parameter", "s",
                       "when the first frame begins, less than a frame period after the start", 0.0, 0.0)


def signals_of(named: list[tuple[str, str, str]]) -> list[Variable]:
    """Return the signals of names, units and meanings."""
    return [Variable(name, FIRST_SIGNAL + k, "output", unit, meaning) for k, (name, unit, meaning) in enumerate(named)]


def parameters_of(values: dict[str, float]) -> list[Variable]:
    """Return the parameters of dotted names."""
    found = []
    for k, (name, value) in enumerate(values.items()):
        metadata = metadata_of(name)
        low, high, is_open = _BOUNDS.get(metadata["rule"], (-math.inf, math.inf, False))
        found.append(Variable(name, FIRST_PARAMETER + k, "parameter", si_unit(metadata["dimension"]),
                              str(metadata["meaning"]), value, low, high, is_open))
    return found


def metadata_of(name: str) -> Any:
    """Return what a group says of a parameter by its dotted name."""
    title, _, own = name.partition(".")
    return next(f.metadata for f in fields(GROUPS[title]) if f.name == own)


def numbers_of(model: Any) -> dict[str, float]:
    """Return the parameters of a model that are given and are numbers, by dotted name."""
    found = {}
    for name in (*model.requires, *model.optional):
        rule, value = metadata_of(name)["rule"], getattr(model.given, field_of(name), math.nan)
        if isinstance(rule, str) and rule != "table" and not math.isnan(value):
            found[name] = float(value)
    return found


def base_units(unit: str) -> dict[str, int]:
    """Return the exponents of SI's base units, and of the radian, in a unit as the package writes it.

    Examples
    --------
    >>> base_units("N m s/rad"), base_units("1/(rad s)")
    ({'kg': 1, 'm': 2, 's': -1, 'rad': -1}, {'rad': -1, 's': -1})
    """
    above, _, below = unit.partition("/")
    powers: dict[str, int] = {}
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for symbol, power in _FACTOR.findall(part):
            for base, own in _BASE[symbol].items():
                powers[base] = powers.get(base, 0) + sign * own * int(power or 1)
    return {base: power for base, power in powers.items() if power}


# --- The model for the functions of FMI, as a header in C -------------------------------------------------------------

_NAMES = ("servo", "state", "signals", "given", "table", "given_table", "make", "init", "advance", "observe",
          "command")
_CODES = ("DONE", "DIVERGED", "STEP_TOO_SMALL", "CHATTER", "TOO_FAST", "CROWDED", "NOT_FINITE", "BAD_COMMAND",
          "IN_THE_PAST", "OTHER_CODE")
_LESS = (("stops.lower_angle", "stops.upper_angle"),
         ("electronics.pulse_width_min", "electronics.pulse_width_max"),
         ("firmware.lower_goal", "firmware.upper_goal"))
_PLACES = ("TIME = 0, COMMAND = 1, TORQUE = 2, ANGLE = 3, FRAMES_BEGIN = 4", f"FIRST_SIGNAL = {FIRST_SIGNAL}",
           f"FIRST_PARAMETER = {FIRST_PARAMETER}")


def model_header(name: str, token: str, variables: Sequence[Variable], *, frames: str) -> str:
    """Return model.h; `frames` is the frame period of `servo` in C, 0.0 where it has none."""
    signals = [each for each in variables if each.causality == "output"]
    parameters = [each for each in variables if each.reference >= FIRST_PARAMETER]
    of = {each.reference: each for each in variables}
    given = {each.name for each in parameters}
    less = [(low, high) for low, high in _LESS if {low, high} <= given]
    start = {reference: 0.0 if (value := of[reference].start) is None else value for reference in (1, 3)}
    lines = [
        f"/* {name}: what the functions of FMI have to know of it. */", "#ifndef MODEL_H", "#define MODEL_H", "",
        "#include <math.h>", f'#include "{name}.h"', "", f'#define MODEL_TOKEN "{token}"',
        f"#define MODEL_COMMAND {start[1]!r}", f"#define MODEL_ANGLE {start[3]!r}",
        f"#define MODEL_FRAMES(s) ({frames})",
        f"#define HAS_FRAMES {int(frames != '0.0')}",
        *(f"#define MODEL_{code} {name.upper()}_{code}" for code in _CODES),
        *(f"#define model_{each} {name}_{each}" for each in _NAMES), "",
        f"enum {{ {', '.join(_PLACES)}, SIGNALS = {len(signals)}, PARAMETERS = {len(parameters)},"
        f" RELATIONS = {len(less)} }};",
        "typedef struct { double low, high; int open; const char *allowed; } model_limit;",
        "typedef struct { size_t low, high; const char *name, *allowed; } model_relation;", "",
        "static const size_t model_signal_places[] = {",
        *(f"    offsetof({name}_signals, {each.name})," for each in signals), "};",
        "static const size_t model_parameters[] = {",
        *(f"    offsetof({name}_given, {field_of(each.name)})," for each in parameters), "};",
        "static const model_limit model_limits[] = {", *(f"    {_limit(each)}," for each in parameters), "};",
        "static const model_relation model_relations[] = {",
        *(f"    {{offsetof({name}_given, {field_of(low)}), offsetof({name}_given, {field_of(high)}),"
          f" {json.dumps(low)}, {json.dumps('less than ' + high)}}}," for low, high in less),
        '    {0, 0, "", ""}', "};",
        "static const char *const model_names[] = {",
        *(f"    [{each.reference}] = {json.dumps(each.name)}," for each in variables), "};",
        f"static const char *const model_allowed[] = {{[COMMAND] = {json.dumps(of[1].allowed)}}};", "", "#endif", ""]
    return "\n".join(lines)


def _limit(variable: Variable) -> str:
    low, high = (("-INFINITY" if x < 0.0 else "INFINITY") if math.isinf(x) else repr(x)
                 for x in (variable.low, variable.high))
    return f"{{{low}, {high}, {int(variable.is_open)}, {json.dumps(variable.allowed)}}}"


# --- The descriptions in an FMU, which say what a tool may set, read and build ----------------------------------------

_STATES = {"2.0": ("canGetAndSetFMUstate", "canSerializeFMUstate"),
           "3.0": ("canGetAndSetFMUState", "canSerializeFMUState")}


def description(version: str, *, name: str, title: str, token: str, variables: Sequence[Variable],
                sources: Sequence[str], step: float) -> bytes:
    """Return modelDescription.xml of FMI 2.0 or 3.0.

    Parameters
    ----------
    version : {"2.0", "3.0"}
    name : str
        The model identifier.
    title : str
        A sentence on what it is.
    token : str
    variables : sequence of Variable
    sources : sequence of str
        Files that are compiled.
    step : float
        Communication step that a tool may begin with [s].
    """
    older = version == "2.0"
    root = Xml.Element("fmiModelDescription", {
        "fmiVersion": version, "modelName": name, "guid" if older else "instantiationToken": token,
        "description": title, "generationTool": f"servotwin {__version__}", "variableNamingConvention": "structured"})
    states = dict.fromkeys(_STATES[version], "true")
    run = Xml.SubElement(root, "CoSimulation", {
        "modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true", **states,
        **({"canNotUseMemoryManagementFunctions": "true"} if older else {"canReturnEarlyAfterIntermediateUpdate":
                                                                         "false"})})
    if older:
        files = Xml.SubElement(run, "SourceFiles")
        for source in sources:
            Xml.SubElement(files, "File", name=source)
    _add_units(root, variables)
    categories = Xml.SubElement(root, "LogCategories")
    for category, words in (("logStatusError", "what is wrong"), ("logAll", "everything")):
        Xml.SubElement(categories, "Category", name=category, description=words)
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(step))
    made = Xml.SubElement(root, "ModelVariables")
    for each in variables:
        _add_older(made, each) if older else _add_newer(made, each)
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [(k, each) for k, each in enumerate(variables, 1) if each.causality == "output"]
    for group, entry in (("Outputs", "Output"), ("InitialUnknowns", "InitialUnknown")):
        place = Xml.SubElement(structure, group) if older else structure
        for k, each in outputs:
            Xml.SubElement(place, *(("Unknown", {"index": str(k)}) if older else
                                    (entry, {"valueReference": str(each.reference)})))
    return _text(root)


def build_description(name: str, sources: Sequence[str]) -> bytes:
    """Return buildDescription.xml of FMI 3.0."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    made = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=name, description="any system with a C compiler")
    files = Xml.SubElement(made, "SourceFileSet", language="C99")
    for each in sources:
        Xml.SubElement(files, "SourceFile", name=each)
    return _text(root)


def _add_units(root: Xml.Element, variables: Sequence[Variable]) -> None:
    units = Xml.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(each.unit for each in variables if each.unit):
        own = Xml.SubElement(units, "Unit", name=unit)
        Xml.SubElement(own, "BaseUnit", {base: str(power) for base, power in base_units(unit).items()})


def _add_older(root: Xml.Element, variable: Variable) -> None:
    kinds = {"parameter": {"variability": "fixed", "initial": "exact"}, "output": {"initial": "calculated"}}
    own = Xml.SubElement(root, "ScalarVariable", {
        "name": variable.name, "valueReference": str(variable.reference), "description": variable.meaning,
        "causality": variable.causality, "variability": "continuous", **kinds.get(variable.causality, {})})
    Xml.SubElement(own, "Real", _numbers(variable))


def _add_newer(root: Xml.Element, variable: Variable) -> None:
    kinds = {"parameter": {"variability": "fixed", "initial": "exact"}, "output": {"initial": "calculated"}}
    Xml.SubElement(root, "Float64", {
        "name": variable.name, "valueReference": str(variable.reference), "description": variable.meaning,
        "causality": variable.causality, "variability": "continuous", **kinds.get(variable.causality, {}),
        **_numbers(variable)})


def _numbers(variable: Variable) -> dict[str, str]:
    said = {"unit": variable.unit} if variable.unit else {}
    said |= {name: repr(value) for name, value in (("min", variable.low), ("max", variable.high))
             if math.isfinite(value)}
    return said | ({"start": repr(variable.start)} if variable.start is not None else {})


def _text(root: Xml.Element) -> bytes:
    Xml.indent(root)
    text: bytes = Xml.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


# --- The library of an FMU, made by the compiler at hand for this machine, and for others where zig is there ----------

_FLAGS = ("-std=c99", "-O2", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno",
          "-fno-trapping-math", "-s")


class Platform(NamedTuple):
    """A system: its folders in FMI 2.0 and 3.0, the ending of libraries, and zig's name of it."""

    older: str
    newer: str
    ending: str
    target: str


PLATFORMS = (
    Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
)
_SYSTEMS = {"linux": "linux", "win32": "windows", "darwin": "darwin"}
_MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


def binaries(version: str, name: str, files: Mapping[str, str], sources: Sequence[str]) -> dict[str, bytes]:
    """Return libraries by their paths in an FMU.

    Parameters
    ----------
    version : {"2.0", "3.0"}
    name : str
    files : mapping of str to str
        Texts by their names.
    sources : sequence of str
        Those that are compiled.

    Raises
    ------
    InputError
        If there is no compiler, or it refuses.
    """
    made = {}
    with tempfile.TemporaryDirectory(prefix="servotwin-fmu-") as folder:
        for file, text in files.items():
            (Path(folder) / file).write_text(text, encoding="utf-8")
        for system, command in _commands():
            library = Path(folder) / f"{name}{system.ending}"
            paths = [str(Path(folder) / each) for each in sources]
            _compile([*command, *_FLAGS, *(() if system.ending == ".dll" else ("-fPIC",)), "-I", folder, "-o",
                      str(library), *paths, "-lm"])
            place = system.older if version == "2.0" else system.newer
            made[f"binaries/{place}/{library.name}"] = library.read_bytes()
    return made


def _commands() -> list[tuple[Platform, Sequence[str]]]:
    """Return the systems that libraries are made for, and how the compiler of each is called."""
    there = compilers()
    zig = next((each for each in there if "ziglang" in each.command), None)
    if zig is not None:
        return [(system, (*zig.command, "-target", system.target)) for system in PLATFORMS]
    newer = f"{_MACHINES.get(platform.machine().lower())}-{_SYSTEMS.get(sys.platform)}"
    own = next((system for system in PLATFORMS if system.newer == newer), None)
    if own is None or not there:
        raise InputError("export fmu", got="no compiler of C" if own else f"{sys.platform} {platform.machine()}",
                         allowed="clang, gcc or the package ziglang; or sources alone (--sources)")
    return [(own, there[0].command)]


def _compile(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = next(iter(done.stderr.strip().splitlines()), "nothing")
        raise InputError("export fmu", got=f"a compiler that refuses: {said}", allowed="one that takes C99")


# --- A servo as an FMU: a component for co-simulation that tools of FMI 2.0 or 3.0 take -------------------------------

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
        The load on the shaft.
    fmi : {"2.0", "3.0"}
    name : str, optional
        The model identifier; that of the servo unless given.
    accuracy : float
        Error that angles may have where motions are integrated [rad].
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
             **{each: _text_fmu(each) for each in ("component.h", "component.c", *_TEXTS[fmi])}}
    compiled = [each for each in texts if each.endswith(".c")]
    title = f"{shown(model.servo.name)} as a {type(model).__name__}"
    contents = {"modelDescription.xml": description(fmi, name=code.name, title=title, token=token, variables=variables,
                                                    sources=compiled, step=_STEP)}
    contents |= {f"sources/{each}": text.encode() for each, text in texts.items()}
    if fmi == "3.0":
        contents["sources/buildDescription.xml"] = build_description(code.name, compiled)
    contents["documentation/licenses/fmi-headers.txt"] = _text_fmu("LICENSE.txt").encode()
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


def _text_fmu(name: str) -> str:
    return files("servotwin.export").joinpath("fmi", name).read_text(encoding="utf-8")

"""The descriptions in an FMU, which say what a tool may set, read and build."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as Xml

from servotwin import __version__
from servotwin.export.fmu_variables import Variable, base_units

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

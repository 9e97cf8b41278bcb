"""Tables that are made from the code when the documentation is built, so that they cannot lie.

    ```{servotwin-table} models
    ```
"""

import importlib
import inspect
import re
from collections.abc import Iterable
from dataclasses import fields

import servotwin as st
from servotwin.bench.wire import protocol
from servotwin.logs import BAM_ACTUATORS, LOG_FORMATS
from servotwin.models import MODELS
from servotwin.models.outputs import SIGNALS
from servotwin.parameters import GROUPS, catalog_names, load_servo
from servotwin.parameters.registers.listing import listed_model, listed_models, rows_of, wire_rows
from servotwin.parameters.servo import AT_OUTPUT, plausible_range
from servotwin.physics.nomenclature import ARGUMENTS
from servotwin.units import DIMENSIONS, si_unit

_GREEK = ("alpha", "beta", "delta", "Delta", "kappa", "tau")
_LATEX = {"q̇": r"\dot q", "q̈": r"\ddot q", "τ": r"\tau", "η": r"\eta", "ω": r"\omega", "δ": r"\delta",
          "⁺": "^+", "⁻": "^-"}
_UNITS = {"ohm": "Ω", "mohm": "mΩ", "us": "µs", "us/V": "µs/V", "mV/us": "mV/µs", "uH": "µH", "deg": "deg"}
_RULES = {"a positive number": "> 0", "a number of at least 0": "≥ 0", "a finite number": "any",
          "a number of at least 1": "≥ 1", "a number from 0 to 1": "0 to 1", "table": "list"}


def markdown(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    lines = [list(header), ["---"] * len(list(header)), *[list(row) for row in rows]]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def symbol(text: str) -> str:
    r"""Return a parameter's symbol as a formula: ``tau_s`` becomes ``$\tau_{s}$``."""
    if not text:
        return ""
    latex = re.sub(r"_(\w+)", r"_{\1}", text)
    for name in _GREEK:
        latex = re.sub(rf"\b{name}(?![a-z])", rf"\\{name}", latex)
    for sign, command in _LATEX.items():
        latex = latex.replace(sign, command)
    return f"${latex}$"


def unit(text: str) -> str:
    """Return a unit as it is printed: "kg m2" becomes "kg m²"."""
    return _UNITS.get(text, text).replace("m2", "m²").replace("s2", "s²").replace(" ", "\N{NO-BREAK SPACE}")


def names() -> list[str]:
    """Return the dotted names of all parameters."""
    return [f"{group}.{f.name}" for group, kind in GROUPS.items() for f in fields(kind)]


def parameters() -> str:
    """All parameters: symbol, unit, range and meaning, a table for each group."""
    parts = []
    for group, kind in GROUPS.items():
        rows = []
        for f in fields(kind):
            rule, dimension = f.metadata["rule"], f.metadata["dimension"]
            allowed = " or ".join(f'`"{word}"`' for word in rule) if isinstance(rule, tuple) else _RULES[rule]
            si = "" if dimension == "word" else unit(si_unit(dimension))
            rows.append((f"`{f.name}`", symbol(f.metadata["symbol"]), si, allowed, _plausible(f"{group}.{f.name}"),
                         _formulas(f.metadata["meaning"])))
        summary = (inspect.getdoc(kind) or "").splitlines()[0]
        parts.append(f"### `{group}`\n\n{summary}\n\n"
                     + markdown(("parameter", "symbol", "unit", "range", "plausible", "meaning"), rows))
    return "\n\n".join(parts)


def _plausible(name: str) -> str:
    """Return the plausible range of a parameter, and where it holds at the output shaft."""
    found = plausible_range(name)
    if found is None:
        return ""
    return f"{found.low:.3g} to {found.high:.3g}" + (" at the output" if name in AT_OUTPUT else "")


def models() -> str:
    """Which model requires, uses or ignores which parameter."""
    kinds = list(MODELS.values())
    rows = []
    for name in names():
        marks = ["●" if name in kind.requires else "(●)" if name in kind.optional else "–" for kind in kinds]
        rows.append((f"`{name}`", *marks))
    return markdown(("parameter", *[_breakable(kind.__name__) for kind in kinds]), rows)


def _breakable(name: str) -> str:
    """Let a long class name go on in the next line."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "\N{ZERO WIDTH SPACE}", name)


def model_list() -> str:
    """The models, their names on the command line and their states."""
    rows = [(f"`{kind.__name__}`", f"`{name}`", (inspect.getdoc(kind) or "").splitlines()[0].rstrip("."),
             ", ".join(f"`{s}`" for s in kind.layout)) for name, kind in MODELS.items()]
    return markdown(("class", "on the command line", "what it is", "states"), rows)


def signals() -> str:
    """All output signals, and which models have them."""
    rows = [("`time`", "s", "time since the start of the run", "all")]
    rows += [(f"`{name}`", unit(output.unit), _formulas(output.meaning), _owners(name))
             for name, output in SIGNALS.items()]
    return markdown(("signal", "unit", "meaning", "models"), rows)


def _owners(signal: str) -> str:
    having = {kind.__name__ for kind in MODELS.values() if signal in kind.signals}
    lacking = {kind.__name__ for kind in MODELS.values()} - having
    if not lacking:
        return "all"
    if lacking == {"DCMotor", "GearedMotor"}:
        return "servos"
    few = sorted(lacking if len(lacking) < len(having) else having)
    return ("all but " if len(lacking) < len(having) else "") + ", ".join(f"`{name}`" for name in few)


def _formulas(text: str) -> str:
    """Set symbols with an index, such as v_a, as formulas."""
    return re.sub(r"(?<![\w`])([a-zA-Zτ])_(\w+)", r"$\1_{\2}$", text)


def units() -> str:
    """Every dimension with its units; the first is the SI one."""
    used = {f.metadata["dimension"] for kind in GROUPS.values() for f in fields(kind)}
    rows = [(dimension, ", ".join(f"`{name}`" for name in known)) for dimension, known in DIMENSIONS.items()
            if dimension in used]
    return markdown(("dimension", "units"), rows)


def catalog() -> str:
    """The servos of the catalog, with the share of what is only assumed, and what their sheets lack."""
    rows = []
    for name in catalog_names():
        servo = load_servo(name)
        origins = [servo.source(parameter).origin for parameter in servo.names()]
        assumed = sum(origin == "assumed" for origin in origins)
        rows.append((f"`{name}`", servo.title, f"{assumed} of {len(origins)}", "; ".join(servo.sheet.get("flags", []))))
    return markdown(("id", "servo", "assumed", "flags of its sheet"), rows)


def log_formats() -> str:
    """The formats of logs."""
    return markdown(("format", "what it is"), [(f"`{name}`", each.what) for name, each in LOG_FORMATS.items()])


def bam_actuators() -> str:
    """BAM's actuators, and what its code says of each."""
    rows = [(f"`{name}`", f"sets the {one.sets}" if one.error_gain is None else f"{one.error_gain:.6g}",
             "" if one.error_gain is None else f"{one.largest_duty:g}", "" if one.speed is None else f"{one.speed:.4g}",
             one.source) for name, one in BAM_ACTUATORS.items()]
    return markdown(("actuator", "duty per radian and unit of the gain [1/rad]", "largest duty", "speed [rad/s]",
                     "where BAM says it"), rows)


def top_level() -> str:
    """What `import servotwin as st` offers, and where it is described."""
    rows = []
    for name in st.__all__:
        if name.startswith("__"):
            continue
        item = getattr(st, name)
        if inspect.ismodule(item):
            rows.append((f"`st.{name}`", "module", f"{{py:mod}}`{item.__name__}`"))
            continue
        module = st._LAZY[name]
        kind = "class" if inspect.isclass(item) else "function"
        rows.append((f"`st.{name}`", kind, f"{{py:obj}}`servotwin.{module}.{name}`"))
    return markdown(("name", "", "described under"), rows)


def api(module: str) -> str:
    """The public names of a module, with the first line of what each says."""
    found = importlib.import_module(module)
    rows = []
    for name in getattr(found, "__all__", [name for name in vars(found) if _is_own(found, name)]):
        item = getattr(found, name)
        described = inspect.isclass(item) or inspect.isroutine(item)
        summary = (inspect.getdoc(item) or "").splitlines()[0] if described else ""
        defined = str(getattr(item, "__module__", None) or module)
        home = module if defined.startswith(module) else ".".join(defined.split(".")[:2])  # where it is described
        rows.append((f"{{py:obj}}`~{home}.{name}`", summary))
    return markdown(("name", "what it is"), rows)


def nomenclature() -> str:
    """Arguments of the laws: symbol, unit and meaning; numbers of a servo file are those of their group."""
    rows = [(f"`{name}`", symbol(one.symbol), unit(one.unit), one.meaning)
            for name, one in ARGUMENTS.items()]
    for group, kind in GROUPS.items():
        rows += [(f"`{f.name}`", symbol(f.metadata["symbol"]), unit(si_unit(f.metadata["dimension"])),
                  f"{_formulas(f.metadata['meaning'])} (`{group}`)")
                 for f in fields(kind) if f.metadata["dimension"] != "word" and f.name in arguments_of_laws()]
    return markdown(("argument", "symbol", "unit", "meaning"), sorted(rows, key=lambda row: row[0].strip("`")))


def arguments_of_laws() -> set[str]:
    """Return the names of the arguments of the functions of `servotwin.physics`."""
    laws = [law for law in vars(st.physics).values() if inspect.isfunction(law)]
    return {name for law in laws for name in inspect.signature(law).parameters}


def protocol_messages() -> str:
    """The messages of the bench's wire."""
    rows = [(f"`{kind.name}`", f"0x{kind.number:02x}", kind.sender, f"`{kind.answer}`" if kind.answer else "",
             kind.text) for kind in protocol().kinds.values()]
    return markdown(("message", "kind", "from", "answer", "what for"), rows)


def protocol_fields() -> str:
    """The fields of these messages, in their order."""
    rows = [(f"`{kind.name}`", f"`{field.name}`", field.type, field.unit, field.text)
            for kind in protocol().kinds.values() for field in kind.fields]
    return markdown(("message", "field", "type", "unit", "what it is"), rows)


def protocol_numbers() -> str:
    """The numbers that both sides keep."""
    return markdown(("name", "value"), [(f"`{name}`", f"{value:g}") for name, value in protocol().numbers.items()])


def protocol_words() -> str:
    """The names of numbers in messages."""
    rows = [(f"`{table}`", ", ".join(f"{number} {name}" for name, number in words.items()))
            for table, words in protocol().words.items()]
    return markdown(("of", "numbers"), rows)


def register_models() -> str:
    """Return the models of bus servos, and of how many of their registers no page prints the value."""
    models = listed_models()
    rows = [(model.family, model.name, str(model.number), str(model.rows), str(model.assumed),
             f"[page]({model.page})" if model.page else "none was seen") for model in models]
    total = ("all", f"{len(models)} models", "", str(sum(m.rows for m in models)), str(sum(m.assumed for m in models)),
             "")
    return markdown(("family", "model", "number", "registers", "assumed", "page"), [*rows, total])


def registers() -> str:
    """Return the registers of every model, each with its value and where that is printed."""
    parts = []
    for model in listed_models():
        rows = [(str(row.address), f"`{row.name}`", str(row.value), f"{row.lower} to {row.upper}",
                 ", ".join(f"`{number}`" for number in row.numbers), row.document or "assumed")
                for row in rows_of(model)]
        head = markdown(("address", "register", "new", "range", "numbers of the firmware", "printed in"), rows)
        parts.append(f"### {model.name}\n\n{model.family}, model number {model.number}; {model.assumed} of "
                     f"{model.rows} assumed.\n\n{head}")
    return "\n\n".join(parts)
def wire_registers(*names: str) -> str:
    """Return the registers of models as they lie in the memory, and what a write to each does."""
    parts = []
    for name in names or ("STS3215-12V", "XL330-M288", "XL430-W250"):
        rows = [(str(row.address), str(row.size), f"`{row.name}`", row.sign, row.memory, row.value, row.range, row.unit,
                 row.source, row.does) for row in wire_rows(listed_model(name))]
        head = ("address", "bytes", "register", "sign", "memory", "new", "range", "unit", "printed in", "a write")
        parts.append(f"### {name}\n\n{markdown(head, rows)}")
    return "\n\n".join(parts)


def recipes() -> str:
    """Servos beside their recipes for MuJoCo's actuators."""
    from recipe_table import HEAD
    from recipe_table import recipes as rows

    return markdown(HEAD, rows())


def _is_own(module, name: str) -> bool:
    item = getattr(module, name)
    return not name.startswith("_") and getattr(item, "__module__", None) == module.__name__


TABLES = {"parameters": parameters, "models": models, "model-list": model_list, "signals": signals,
          "units": units, "catalog": catalog, "log-formats": log_formats,
          "bam-actuators": bam_actuators, "top-level": top_level, "api": api, "nomenclature": nomenclature,
          "register-models": register_models, "registers": registers, "wire-registers": wire_registers,
          "protocol-messages": protocol_messages, "protocol-fields": protocol_fields,
          "protocol-numbers": protocol_numbers, "protocol-words": protocol_words, "recipes": recipes}


def setup(app):
    from docutils import nodes
    from sphinx.util.docutils import SphinxDirective

    class Table(SphinxDirective):
        required_arguments = 1
        optional_arguments = 1

        def run(self):
            which, *about = self.arguments
            if which not in TABLES:
                raise self.error(f"unknown table {which!r}, there are: {', '.join(TABLES)}")
            made = self.parse_text_to_nodes(TABLES[which](*about), allow_section_headings=True)
            for node in made:
                for table in node.findall(nodes.table):
                    table["classes"] += ["wide", *(["marks"] if which == "models" else [])]
            return made

    app.add_directive("servotwin-table", Table)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}

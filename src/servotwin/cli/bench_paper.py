"""`servotwin bench paper`: the paper's five voltages through the emulated bench, beside Table II."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, patience, show, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.bench.emulator.paper_chain import ChainRow

_TABLE = "urrea-kern-table-2"
_FRAME = 1.0 / 61.0  # s, as Table II prints it
_SHOWN = 3  # pulses
_PICTURES = ((0, 22), (2, 23), (4, 24))  # row of the table, number of the paper's figure


def bench_paper(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for table and oscilloscope pictures.")] = Path(
        "bench-paper"),
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Run the paper's bench in emulation."""
    from servotwin.bench import compare
    from servotwin.bench.emulator.paper_chain import chain_rows
    from servotwin.parameters import load_dataset
    from servotwin.plotting import save
    from servotwin.tables import csv_text

    names = ["table-2.csv", *(f"oscilloscope-{number}.png" for _, number in _PICTURES)]
    files = _files(out, names, force=force)
    columns = load_dataset(_TABLE).columns
    with patience("emulating the bench"):
        rows = chain_rows([float(v) for v in columns["V_i_V"]])
    off = compare(rows, columns)
    facts = [_facts(row) for row in rows]
    text = csv_text({name: [one[name] for one in facts] for name in facts[0]})
    files[0].write_text(text, encoding="utf-8")
    for (k, _), file in zip(_PICTURES, files[1:], strict=True):
        save(_oscilloscope(rows[k], 1e-6 * float(columns["t_a_us"][k])), file, overwrite=True)
    if as_json:
        emit_json({"rows": facts, "differences": [one._asdict() for one in off], "files": [str(f) for f in files]})
        return
    header = ("V_i", "ADC_i", "t_a", "q", "V_o", "ADC_o", "display after an approach from below")
    made = [(f"{one['V_i_V']:.3f} V", _beside(one["ADC_i"], d.command_count),
             _beside(one["t_a_us"], round(1e6 * d.pulse_width), "us"),
             _beside(one["q_deg"], math.degrees(d.output_angle), "deg", 2),
             _beside(one["V_o_V"], d.feedback_voltage, "V", 3), _beside(one["ADC_o"], d.feedback_count),
             " | ".join(row.displays[0])) for one, d, row in zip(facts, off, rows, strict=True)]
    show("emulated (less Table II of the paper)", "", table(header, made), "",
         "written: " + ", ".join(map(str, files)))


def _files(out: Path, names: Sequence[str], *, force: bool) -> list[Path]:
    from servotwin.errors import OutputError, OutputExistsError

    if out.exists() and not out.is_dir():
        raise OutputError(f"--out {out} is no folder")
    files = [out / name for name in names]
    for file in files:
        if file.exists() and not force:
            raise OutputExistsError(file)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"--out {out} cannot be made ({error.strerror})") from None
    return files


def _facts(row: ChainRow) -> dict[str, Any]:
    one = row.reading
    return {"V_i_V": one.command_voltage, "ADC_i": one.command_count, "t_a_us": round(1e6 * one.pulse_width),
            "f_Hz": round(one.pulse_rate, 3), "q_deg": math.degrees(one.output_angle),
            "V_o_V": one.feedback_voltage, "ADC_o": one.feedback_count}


def _beside(value: float, off: float, unit: str = "", digits: int = 0) -> str:
    shown = f"{value:.{digits}f} {unit}".rstrip()
    return f"{shown} ({off:+z.{digits}f})"


def _oscilloscope(row: ChainRow, printed: float) -> Figure:
    """Draw the last pulses at the pin, and below them what Table II prints."""
    from servotwin.plotting.panels import Train, pulses

    start = row.pulses[0][0]
    edges, widths = [rise - start for rise, _ in row.pulses[:_SHOWN]], [width for _, width in row.pulses[:_SHOWN]]
    paper = Train(f"Table II: {1e6 * printed:.0f} µs, 61 Hz", [k * _FRAME for k in range(len(edges))],
                  [printed] * len(edges))
    return pulses(edges, widths, frame_period=edges[1], beside=paper, label="pin of the emulated board")

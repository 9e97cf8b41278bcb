"""`servotwin bench`: a real servo on a board, or the firmware of the board in emulation, and what they tell."""

from __future__ import annotations

import contextlib
import shutil
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import bench_options as words
from servotwin.cli import shared_options as shared
from servotwin.cli.bench_calibrate import calibrate
from servotwin.cli.bench_paper import bench_paper
from servotwin.cli.bench_record import record, rehearse
from servotwin.cli.bench_video import MARKER_EPILOG, MARKER_HELP, VIDEO_EPILOG, VIDEO_HELP, marker, video
from servotwin.cli.terminal import emit, emit_help, emit_json, pairs, show, table, typed

if TYPE_CHECKING:
    from servotwin.bench.recording import AnalogRig

_LOOK = 0.5  # s over which a check averages

bench = typer.Typer(
    help="Record logs of a real servo, or rehearse it with an emulated board.",
    epilog="Example: servotwin bench rehearse hitec-hs-755hb --range 1000us:2000us --voltage 6V --current-limit 2A "
           "--out rehearsal")


@bench.callback(invoke_without_command=True)
def _bench(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@bench.command("list", help="List serial ports, and which tools of the bench are installed.",
               epilog="Example: servotwin bench list")
def list_ports(as_json: shared.JsonOption = False) -> None:
    """List ports and tools."""
    from servotwin.bench.backends import serial_ports

    found = serial_ports()
    tools = {"avrdude": "flash", "cc": "rehearse, with libsimavr-dev and libelf-dev"}
    there = {name: shutil.which(name) or "" for name in tools}
    if as_json:
        emit_json({"ports": [one._asdict() for one in found], "tools": there})
        return
    ports = [(one.device, one.identity or "-", one.description) for one in found]
    show(table(("port", "USB", "what it says of itself"), ports) if ports else "no serial port on this computer", "",
         pairs([(name, (there[name] or "not installed") + f" (for {use})") for name, use in tools.items()]))


@bench.command(help="Ask the board who it is, and read its channels.",
               epilog="Example: servotwin bench check --port /dev/ttyUSB0 --wiring bench.toml")
def check(port: words.PortOption = None, wiring: words.WiringOption = None, as_json: shared.JsonOption = False) -> None:
    """Ask the board how it does; nothing moves."""
    from servotwin.bench.backends import SerialBackend
    from servotwin.bench.recording import AnalogRig

    rig = AnalogRig(SerialBackend(words.port_from(port)), words.wiring_from(wiring))
    with contextlib.closing(rig):
        identity = rig.open()
        channels = _channels(rig)
        status = dict(rig.board.order("ask"))
    wire = {"bad_frames": rig.board.splitter.bad, "lost_frames": rig.board.splitter.lost,
            "bad_frames_board": status["bad"], "dropped_frames": status["dropped"], "late_edges": status["late"]}
    if as_json:
        emit_json({"port": rig.board.backend.name, "firmware": identity.firmware, "mode": identity.mode,
                   "channels": channels, **wire})
        return
    rows = [(name, f"{one['count']:.2f}", f"{one['std_count']:.2f}", f"{one['value']:.4g} {one['unit']}")
            for name, one in channels.items()]
    show(pairs([("board", rig.board.backend.name), ("firmware", identity.firmware), ("mode", identity.mode),
                ("wire", ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in wire.items()))]), "",
         table(("channel", "count", "noise", "which is"), rows), *_remarks(channels))


def _channels(rig: AnalogRig) -> dict[str, dict[str, Any]]:
    import statistics

    made = {}
    for name, counts in rig.measure(_LOOK).items():
        mean = statistics.fmean(counts)
        made[name] = {"count": mean, "std_count": statistics.pstdev(counts), "value": rig.wiring.value(name, mean),
                      "unit": "A" if name == "shunt" else "V"}
    return made


def _remarks(channels: dict[str, dict[str, Any]]) -> list[str]:
    return [f"- {name} is at the end of the converter; is it wired, and its divider right?"
            for name, one in channels.items() if (one["count"] < 1.0 and name != "shunt") or one["count"] > 1021.0]


@bench.command(help="Put the firmware onto an Uno or a Nano, by avrdude.",
               epilog="Example: servotwin bench flash --port /dev/ttyUSB0 --board nano")
def flash(
    port: words.PortOption = None,
    board: Annotated[str, typer.Option(
        metavar="BOARD", help="uno, nano, or nano-old (the boot loader of old ones and of most copies).")] = "nano",
) -> None:
    """Flash the firmware."""
    from servotwin.bench.flash import flash as put

    where = words.port_from(port)
    put(where, board)
    emit(f"the firmware of the bench is on the board at {where}; next: "
         + typed("servotwin", "bench", "check", "--port", where))


_RANGE = "--range 1000us:2000us --voltage 6V --current-limit 0.8A"
bench.command("calibrate", help="Measure the wires of the bench with a multimeter, or angle over tap with a dial.",
              epilog="Example: servotwin bench calibrate supply --wiring bench.toml\n\n"
                     "Example: servotwin bench calibrate angle --range 1000us:2000us --voltage 6V "
                     "--current-limit 0.8A --servo hitec-hs-422 --out my-servo.toml")(calibrate)
bench.command("record", help="Record experiments with a servo into logs that servotwin fit reads.",
              epilog=f"Example: servotwin bench record hitec-hs-422 --experiment steps,chirp {_RANGE} --out runs\n\n"
                     "Example: servotwin bench record feetech-sts3215-12v --bus feetech --id 1 --range -60deg:60deg "
                     "--voltage 12V --current-limit 1.5A --out runs")(record)
bench.command("rehearse", help="Record experiments from an emulated bench: the firmware itself beside a simulated "
              "servo.",
              epilog=f"Example: servotwin bench rehearse hitec-hs-755hb -e steps,chirp {_RANGE} --out rehearsal"
              )(rehearse)
bench.command("paper", help="Run the paper's five voltages through the emulated bench, beside its Table II.",
              epilog="Example: servotwin bench paper --out bench-paper")(bench_paper)
bench.command("marker", help=MARKER_HELP, epilog=MARKER_EPILOG)(marker)
bench.command("video", help=VIDEO_HELP, epilog=VIDEO_EPILOG)(video)

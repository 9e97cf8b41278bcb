"""`servotwin wire`: servos that are not there, at a serial port where programs look for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import usual, with_records
from servotwin.cli.terminal import emit, emit_json
from servotwin.errors import InputError, one_line

if TYPE_CHECKING:
    from servotwin.wire import Bus
    from servotwin.wire.arms import Asked
    from servotwin.wire.service import Service

_MOST_PORT = 65535


@dataclass(frozen=True, kw_only=True)
class _Servos:
    """The options that say which servos are on the wire and how they are, as they were typed."""

    servo: Annotated[Sequence[str], typer.Option(
        metavar="ID=SERVO", help="A servo on the wire, such as 1=feetech-sts3215-12v; repeatable. It replaces the "
        "arm's of that ID.")] = ()
    supply: Annotated[str | None, typer.Option(
        metavar=shared.SUPPLY_FORM, help=f"Supply that all share: {shared.SUPPLY_HELP} (default: an ideal one a "
        "voltage).")] = None
    register: shared.RegisterOption = ()
    lock: Annotated[str, typer.Option(
        metavar="HOW", help="A write to the EEPROM while Lock is 1: keep (until power-off), or drop.")] = "keep"
    firmware: Annotated[str | None, typer.Option(
        metavar="MAJOR.MINOR", help="Version that the servos tell (default 3.10; Dynamixel 45).")] = None
    body: Annotated[bool, typer.Option(
        "--body/--no-body", help="Hang so101's servos at its links (robots extra), or let the shafts be free.")] = True

    def asked(self, arm: str | None, faults: Any, seed: int) -> Asked:
        """Return what is asked for of the servos of an arm."""
        from servotwin.wire.arms import Asked

        return Asked(arm=arm, servos=_servos(self.servo), supply=self.supply, registers=tuple(self.register),
                     lock=self.lock, firmware=_version(self.firmware), faults=faults, body=self.body, seed=seed)


@usual("servo", "link", "keep", "tcp", "record", "duration", "json")
@with_records
def wire(
    *,
    arm: Annotated[str | None, typer.Argument(
        metavar="[ARM]", help="so101 or koch, or path of an arm file (.toml); none: the servos of --servo.")] = None,
    servos: _Servos,
    link: Annotated[Path | None, typer.Option(
        metavar="PATH", help="Link to the port, such as /tmp/so101; it appears when the servos are ready.")] = None,
    keep: Annotated[Path | None, typer.Option(
        metavar="FILE", help="File in which stored registers (calibration) outlive this process.")] = None,
    tcp: Annotated[str | None, typer.Option(
        metavar="[HOST:]PORT", help="A TCP port instead of a pseudo-terminal, for pyserial's socket://; 0 for any that "
        "is free, at this computer alone unless HOST is given.")] = None,
    hand: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="What a hand does to limp servos: columns time_s and, by joint or ID, angles in "
        "degrees, such as shoulder_pan_deg; it begins anew at its end.")] = None,
    record: Annotated[Path | None, typer.Option(
        metavar="FOLDER", help="Logs of what programs read, a file a servo, and the truth beside; servotwin fit reads "
        "them.")] = None,
    faults: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="What is wrong with the wire: a table named fault, with a kind, for each.")] = None,
    duration: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="End by itself after this time.")] = None,
    seed: Annotated[int, typer.Option(metavar="NUMBER", help="Seed of all noise and faults.")] = 0,
    as_json: shared.JsonOption = False,
) -> None:
    """Serve the port until Ctrl-C."""
    from servotwin.wire.arms import arm_bus, hand_of
    from servotwin.wire.bus import read_faults

    if duration is not None and not 0.0 < duration < 1e7:
        raise InputError("--duration", got=duration, allowed="a positive number of seconds")
    wrong = read_faults(faults, seed) if faults else None
    bus, names = arm_bus(servos.asked(arm, wrong, seed), registers=_written)
    logs = bus.record(record) if record is not None else None
    _serve(bus, names, tcp=_tcp(tcp), link=link, keep=keep, each=hand_of(hand, bus, names) if hand else None,
           duration=duration, as_json=as_json, logs=logs)


def _written(servo: Any, words: tuple[str, ...]) -> Any:
    from servotwin.cli.shared_options import with_registers

    return with_registers(servo, words)


def _serve(bus: Bus, names: dict[int, str], *, tcp: tuple[str, int] | None, link: Path | None, keep: Path | None,
           each: Any, duration: float | None, as_json: bool, logs: Any) -> None:
    import sys

    from servotwin.cli import interrupts
    from servotwin.wire.service import Service

    def say(line: str) -> None:
        sys.stderr.write(f"servotwin: {one_line(line)}\n")
        sys.stderr.flush()

    service = Service(bus, tcp=tcp, link=link, keep=keep, say=say, each=each)
    def tidy() -> None:
        service.tidy()
        if logs is not None:
            logs.flush()

    try:
        with interrupts.last_words(tidy):
            _tell(bus, names, service, link, as_json=as_json)
            service.run(duration)
    finally:
        service.stop()
        if logs is not None:
            logs.close()
    if service.error is not None:
        raise service.error


def _tell(bus: Bus, names: dict[int, str], service: Service, link: Path | None, *, as_json: bool) -> None:
    """Say where the port is, and who is there."""
    if as_json:
        emit_json({"port": service.port, "link": None if link is None else str(link), "protocol": bus.protocol,
                   "servos": {str(id): names.get(id, "") for id in bus.ids}})
        return
    who = ", ".join(f"{id} {names.get(id, '')}".rstrip() for id in bus.ids)
    emit(f"{bus.protocol} at {link or service.port}: {who}  (Ctrl-C ends it)")
    if not service.tells_rate:
        emit("the speed that a program sets is not seen here: servos answer at every one")


def _servos(words: Sequence[str]) -> dict[int, str]:
    found: dict[int, str] = {}
    for word in words:
        id, equals, name = word.partition("=")
        if not equals or not id.strip().isdecimal() or not name.strip():
            raise InputError("--servo", got=word, allowed="ID=SERVO, such as 1=feetech-sts3215-12v")
        if int(id) in found:
            raise InputError("--servo", got=f"ID {int(id)} twice", allowed="each ID once; two servos of one ID are a "
                             "fault: kind = \"duplicate\" in --faults")
        found[int(id)] = name.strip()
    return found


def _version(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    parts = text.split(".")
    if not all(part.isdecimal() for part in parts) or len(parts) > 2:
        raise InputError("--firmware", got=text, allowed="a version, such as 3.10")
    return tuple(int(part) for part in parts)


def _tcp(text: str | None) -> tuple[str, int] | None:
    if text is None:
        return None
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or int(port) > _MOST_PORT:
        raise InputError("--tcp", got=text, allowed=f"a port from 0 to {_MOST_PORT}, or HOST:PORT")
    return host or "127.0.0.1", int(port)

"""`servotwin bench marker` and `servotwin bench video`: the angle of a horn out of a phone's clip."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, json_text, pairs, patience, show

if TYPE_CHECKING:
    from servotwin.bench.video import Filmed
    from servotwin.bench.video.instant import Region
    from servotwin.cli.outputs import Target

_PICTURES = (".svg", ".pdf", ".png")
_ZERO, _TIME = "Angle", "Time"  # panels of the help

MARKER_HELP = "Print a mark for the horn, whose angle `servotwin bench video` reads."
MARKER_EPILOG = "Example: servotwin bench marker --side 20mm --out horn.pdf"
VIDEO_HELP = "Read the angle of a marked horn out of a phone's clip."
VIDEO_EPILOG = "Example: servotwin bench video clip.mp4 --log step.csv --instant led --out filmed.csv"


def marker(
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where to write it: .svg, .pdf or .png, at its true size.")],
    side: Annotated[str, typer.Option(metavar="LENGTH", help="Of the black square, such as 20mm; the piece to cut out "
                                      "is half as large again.")] = "20mm",
    mark: Annotated[int, typer.Option("--id", metavar="ID", help="0 for the horn, 1 for the case.")] = 0,
    dpi: Annotated[float, typer.Option(metavar="NUMBER", help="Pixels an inch of a .png.")] = 600.0,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a mark with a ruler that checks the printer."""
    from servotwin.bench.video import mark_bytes
    from servotwin.cli.outputs import Target, check_targets, staged
    from servotwin.units.quantities import quantity

    length = quantity("--side", side, "length", positive=True)
    targets = [Target(option="--out", path=out, endings=_PICTURES)]
    check_targets(targets, force=force)
    content = mark_bytes(out.suffix.lower()[1:], side=length, mark=mark, dpi=dpi)
    with staged(targets, force=force) as drafts:
        drafts[0].write_bytes(content)
    show(pairs([("mark", f"{mark}, black side {1e3 * length:g} mm"), ("written", str(out))]),
         "  Print it at 100 % on plain paper and measure the bar: it is 50 mm long.")


def video(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="The clip, such as .mp4 or .mov.")],
    out: Annotated[Path, typer.Option(metavar="FILE.csv", help="Where to write the log; its sidecar is put beside it.",
                                      rich_help_panel=shared.OUTPUT)],
    log: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="The recorder's log of the same run, which has "
                                             "the command; a fit needs it.", rich_help_panel=_TIME)] = None,
    mend: Annotated[list[str] | None, typer.Option(
        metavar="KIND", help="What to put right in the recorder's log first, see servotwin log; repeatable.",
        rich_help_panel=_TIME)] = None,
    instant: Annotated[str | None, typer.Option(metavar="led|jump|none|TIME", help=(
        "Where clip and log meet: a light that goes on at the log's time 0, the first motion (which is that after the "
        "first change of the command), the first picture, or a time in the clip such as 1.25s (default: jump; led "
        "with --led)."), rich_help_panel=_TIME)] = None,
    led: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Where the light is in the picture, in pixels from "
                                            "its upper left corner.", rich_help_panel=_TIME)] = None,
    slow: Annotated[float, typer.Option(metavar="FACTOR", help="By how much the clip plays slower than it was filmed: "
                                        "8 for 240 pictures a second that play at 30.", rich_help_panel=_TIME)] = 1.0,
    mark: Annotated[int, typer.Option("--id", metavar="ID", help="Of the mark on the horn.",
                                      rich_help_panel=_ZERO)] = 0,
    zero: Annotated[str | None, typer.Option(metavar="ANGLE", help=(
        "Angle in the first picture, such as 12deg (default: counted from the mark on the case, else from the "
        "picture's horizontal)."), rich_help_panel=_ZERO)] = None,
    flip: Annotated[bool, typer.Option("--flip", help="Count clockwise, as the camera sees it, as positive.",
                                       rich_help_panel=_ZERO)] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.",
                                        rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Write the angle of a marked horn as a log."""
    from servotwin.bench.video import read_clip
    from servotwin.bench.video.film_log import film_log
    from servotwin.cli.fit_words import reading_mends
    from servotwin.cli.outputs import check_targets
    from servotwin.units.quantities import quantity

    targets = _targets(out)
    check_targets(targets, force=force, inputs=[clip] if log is None else [clip, log])
    options: dict[str, Any] = {
        "mark": mark, "flip": flip, "slow": slow, "instant": _instant(instant, led), "led": _region(led),
        "zero": None if zero is None else quantity("--zero", zero, "angle")}
    with patience(f"looking at {clip}"):
        filmed = read_clip(clip, **options)
    made = film_log(filmed, log, mend=reading_mends(mend))
    _write(targets, made.text, json_text(made.sidecar) + "\n", force=force)
    remarks = [*filmed.remarks, *made.remarks]
    files = [str(target.path) for target in targets]
    if as_json:
        emit_json({"video": dict(made.sidecar["recorded"]["video"]), "remarks": remarks, "files": files})
        return
    _show(filmed, remarks, files, commanded=log is not None)


def _targets(out: Path) -> list[Target]:
    from servotwin.cli.outputs import Target
    from servotwin.logs.sidecar import sidecar_path

    return [Target(option="--out", path=out, endings=(".csv",)),
            Target(option="--out, its sidecar", path=sidecar_path(out), endings=(".json",))]


def _region(words: str | None) -> Region | None:
    from servotwin.errors import InputError

    if words is None:
        return None
    parts = [part.strip() for part in words.split(",")]
    if len(parts) != 4 or not all(part.isascii() and part.isdigit() for part in parts):
        raise InputError("--led", got=words, allowed="X,Y,W,H in whole pixels, such as 620,80,24,24")
    left, top, width, height = map(int, parts)
    return left, top, width, height


def _instant(words: str | None, led: str | None) -> str | float:
    from servotwin.errors import InputError
    from servotwin.units.quantities import quantity

    if led is not None and words not in (None, "led"):
        raise InputError("--led", got=f"with --instant {words}", allowed="--instant led, or none at all")
    if words is None:
        return "jump" if led is None else "led"
    if words in ("led", "jump", "none"):
        return words
    if not any(c.isdigit() for c in words):
        raise InputError("--instant", got=words, allowed="led, jump, none, or a time in the clip, such as 1.25s")
    return quantity("--instant", words, "time")


def _write(targets: list[Target], text: str, sidecar: str, *, force: bool) -> None:
    from servotwin.cli.outputs import staged

    with staged(targets, force=force) as drafts:
        drafts[0].write_bytes(text.encode())
        drafts[1].write_bytes(sidecar.encode())


def _show(filmed: Filmed, remarks: list[str], files: list[str], *, commanded: bool) -> None:
    facts = filmed.facts
    rows = [
        ("clip", f"{facts['pictures']} pictures of {facts['width_px']} x {facts['height_px']} in "
                 f"{facts['seconds']:.3f} s, {facts['shortest_interval_s'] * 1e3:.1f} to "
                 f"{facts['longest_interval_s'] * 1e3:.1f} ms apart"),
        ("mark", f"{facts['mark']}, {facts['side_px']:.0f} pixels wide, seen in {facts['seen']} pictures, tilted by "
                 f"{facts['tilt_deg']:.0f} deg"),
        ("angle", f"standard error {facts['angle_std_deg']:.3f} deg at rest; {facts['turned']}, from {facts['zero']}"),
        ("time 0", f"{filmed.instant.kind}, at {filmed.instant.time:.4f} s of the clip, standard error "
                   f"{1e3 * filmed.instant.error:.1f} ms")]
    rows += [("remark", one) for one in remarks]
    if not commanded:
        rows.append(("remark", "there is no command in it: --log, with the recorder's log, makes it one for a fit"))
    show(pairs([*rows, *(("written", name) for name in files)]))

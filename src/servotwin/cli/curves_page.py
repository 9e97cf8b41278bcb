"""The page of one or more computed sheets: HTML that needs nothing but itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin import plotting
from servotwin.cli.curves_words import CurveRow, hot_words, lift_pairs, notes, rest_pairs, rows
from servotwin.cli.loop_words import loop_pairs
from servotwin.look import document, escape, picture, table, to_bytes
from servotwin.parameters import printed_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from servotwin.datasheet import DataSheet, VoltageSheet

_STYLE = """
figure img.drawing{width:100%;max-width:30rem}figure.wide img.drawing{width:100%;max-width:54rem}
.sheet td:nth-child(n+2),.sheet th:nth-child(n+2){text-align:right;font-variant-numeric:tabular-nums}
.sheet td:nth-child(5){font-weight:600}.pairs td:first-child{white-space:nowrap;color:var(--soft)}
.yes{border-left-color:#009e73;background:#f0faf6}
@media print{section.servo{break-before:page}section.servo:first-of-type{break-before:auto}}
"""


def page(sheets: Sequence[DataSheet], torque: float | None = None) -> str:
    """Return the page of some sheets; `torque` is a load whose point on the curves is shown as well [N m]."""
    names = [sheet.servo.title or sheet.servo.name for sheet in sheets]
    title = names[0] if len(sheets) == 1 else f"{len(sheets)} servos beside each other"
    top = "" if len(sheets) == 1 else _contents(sheets, names)
    body = "".join(_servo(sheet, torque, alone=len(sheets) == 1) for sheet in sheets)
    lead = ("What the parameters of the servo file say, computed; what the maker's sheet prints stands beside it, and "
            "how far the computed value is off. Deviations are findings: of the sheet, of the file, or of both.")
    return document(f"{title}: computed sheet", f"<h1>{escape(title)}</h1>\n<p class=\"lead\">{lead}</p>\n{top}{body}"
                    f"<section><h2>How to read this page</h2>{_READING}</section>\n", style=_STYLE)


def _contents(sheets: Sequence[DataSheet], names: Sequence[str]) -> str:
    items = "".join(f'<li><a href="#{escape(sheet.servo.name)}">{escape(name)}</a></li>'
                    for sheet, name in zip(sheets, names, strict=True))
    drawn = _figure([plotting.compared_curves(sheets, page=page)
                     for page in plotting.pages(len(sheets), plotting.CURVES_A_PAGE)],
                    "Torque and current over speed at full drive, cold, each servo at the first of its voltages. Open "
                    "marks are what the sheets print for it.", wide=True)
    return f'<nav aria-label="Contents"><ol>{items}</ol></nav>\n{drawn}'


def _servo(sheet: DataSheet, torque: float | None, *, alone: bool) -> str:
    servo = sheet.servo
    heading = "" if alone else f"<h2>{escape(servo.title or servo.name)}</h2>\n"
    known = "".join(f"<li>{escape(note)}</li>" for note in notes(sheet))
    said = f'<div class="note"><ul>{known}</ul></div>\n' if known else ""
    parts = "".join(_voltage(sheet, part, torque) for part in sheet.voltages)
    pages = plotting.pages(len(sheet.voltages), plotting.CURVES_A_PAGE)
    hot = escape(_degrees(hot_words(sheet.voltages[0])))
    drawn = _figure([plotting.speed_curves(sheet, page=page) for page in pages], "At full drive over speed: cold "
                    f"(25 °C) and hot ({hot}). Open marks are what the sheet prints.", wide=True)
    small = _figure([plotting.holding_curves(sheet, page=page) for page in pages], "How far a constant load pulls the "
                    "servo off its command, 1.5 to 2 s after it was put on, or longer by what a protection waits.")
    loops = [part.loop for part in sheet.voltages if part.loop is not None]
    if loops:
        drawn += _figure([plotting.loop_curve(loops, page=page)
                          for page in plotting.pages(len(loops), plotting.LOOPS_A_PAGE)],
                         "The torque that the program gives while an error stands. A load in the grey stays where it "
                         "is, held by friction; the right half is the middle of the left one.", wide=True)
    if any(part.bandwidth for part in sheet.voltages):
        small += _figure([plotting.bandwidth_curves(sheet, page=page) for page in pages], "Up to which frequency the "
                         "free servo follows sines within 3 dB, over their amplitude. What is not followed at 1 Hz has "
                         "no mark.")
    lifts = [(part.voltage, part.lift) for part in sheet.voltages if part.lift is not None]
    if lifts:
        small += _figure([plotting.lift_curve(lifts)], "What the mass takes over the angle of its arm, and the most "
                         "that the servo lifts.")
    facts = f"<code>{escape(servo.name)}</code>, {escape(servo.kind)}, computed by {type(sheet.model).__name__}"
    return (f'<section class="servo" id="{escape(servo.name)}">{heading}<p class="lead">{facts}</p>\n{said}{drawn}'
            f'{parts}<div class="figures">{small}</div></section>\n')


def _voltage(sheet: DataSheet, part: VoltageSheet, torque: float | None) -> str:
    found = rows(part, printed_points(sheet.servo), torque)
    cells = [[escape(_degrees(cell)) for cell in _minus(row)] for row in found]
    drawn = table(["", "cold", "hot", "the sheet prints", "off"], cells,
                  caption=f"At {part.voltage:g} V. Cold: 25 °C. Hot: {escape(_degrees(hot_words(part)))}.")
    below = _rest(part) + _loop(part, torque) + _lift(part)
    return f'<h3>At {part.voltage:g} V</h3>\n{_cards(part)}<div class="sheet">{drawn}</div>\n{below}'


def _cards(part: VoltageSheet) -> str:
    shown = [(f"{part.cold.stall_torque:.2f} N m", "stall torque"),
             (f"{part.cold.time_60:.2f} s", "for 60° without load"),
             (f"{part.cold.stall_current:.2f} A", "standing at full drive")]
    if not math.isnan(part.smallest_move):
        shown.append((f"{math.degrees(part.smallest_move):.2f}°", "smallest move"))
    listed = "".join(f"<li><b>{value}</b>{words}</li>" for value, words in shown)
    return f'<ul class="numbers">{listed}</ul>\n'


def _rest(part: VoltageSheet) -> str:
    found = rest_pairs(part)
    if not found:
        return ""
    said = table(["At rest", ""], [[escape(_degrees(words)) for words in pair] for pair in found], text_columns=2)
    return f'<div class="pairs">{said}</div>\n'


def _loop(part: VoltageSheet, torque: float | None) -> str:
    if part.loop is None:
        return ""
    said = table(["The loop at rest", ""], [[escape(_degrees(words)) for words in pair]
                                            for pair in loop_pairs(part.loop, torque)], text_columns=2)
    return f'<div class="pairs">{said}</div>\n'


def _lift(part: VoltageSheet) -> str:
    if part.lift is None:
        return ""
    said = table(["Lifting", ""], [[escape(_degrees(words)) for words in pair] for pair in lift_pairs(part.lift)],
                 text_columns=2)
    verdict = "lifts it" if part.lift.lifts else "does not lift it at all angles"
    kind = "note yes" if part.lift.lifts else "note"
    return (f'<div class="{kind}"><p>At {part.voltage:g} V the servo {verdict}.</p></div>\n'
            f'<div class="pairs">{said}</div>\n')


def _minus(row: CurveRow) -> list[str]:
    return [cell.replace("-", "−") if k == len(row) - 1 else cell for k, cell in enumerate(row)]


def _degrees(text: str) -> str:
    """Return a text of the terminal with the signs that a page can show."""
    return text.replace(" deg C", " °C").replace("deg/s", "°/s").replace(" deg", "°").replace(" us)", " µs)")


def _figure(drawn: Sequence[Figure], words: str, *, wide: bool = False) -> str:
    """Return the pages of a picture, one below the other, with words below them."""
    images = "".join(picture(to_bytes(figure, "svg"), words, kind="drawing") for figure in drawn)
    return f'<figure{" class=wide" if wide else ""}><div>{images}</div><figcaption>{words}</figcaption></figure>\n'


_READING = """<ul>
<li><b>Full drive.</b> Far from its goal a servo drives without a pause, a digital one at the most duty that its
program gives. Speed, torque and current are those
of steady motion: motor, bridge, source, current limit and the friction of the gear, which grows with the load.</li>
<li><b>Stall torque.</b> Where the shaft just stands. Sheets print the same, some rounded up, some impossible.</li>
<li><b>Time for 60°.</b> At the speed without load, as sheets print it; a real step also speeds up and settles.</li>
<li><b>Hot.</b> Copper gains 0.385 % of resistance per kelvin; magnets lose 0.15 %, assumed, where the file does not
say.</li>
<li><b>Smallest move.</b> The smallest step of the command that the free shaft follows to half within a second, from
where there is no error.</li>
<li><b>Holding.</b> The load is put on where there is no error; an analog servo gives way until its pulses are long
enough, a digital one until its duty is large enough, or it trips.</li>
<li><b>After ten minutes.</b> Where the file has no thermal numbers they are assumed by mass: 5 % of it copper, the rest
800 J/(kg K), time constants of 17 s and 8.7 min at 45 g that grow with the cube root of mass.</li></ul>
"""

"""A result described once: what the terminal prints of it and what a page of HTML shows."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin.look.page import MINUS, document, picture
from servotwin.look.page import table as html_table
from servotwin.text import escape

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Table:
    """Rows of words with a head; on a page all columns but the first `text_columns` are numbers, of a `kind` of CSS."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text_columns: int = 1
    kind: str = ""

    @property
    def html(self) -> str:
        """It on a page, with the signs that a page can show."""
        drawn = html_table([escape(cell) for cell in self.head],
                           [[escape(signs(cell)) for cell in row] for row in self.rows],
                           caption=escape(signs(self.caption)), text_columns=self.text_columns)
        return f'<div class="{self.kind}">{drawn}</div>\n' if self.kind else drawn


@dataclass(frozen=True)
class Pairs:
    """Names, each with what is said of it, perhaps under a title."""

    rows: Sequence[tuple[str, str]]
    title: str = ""

    @property
    def html(self) -> str:
        """It on a page: a sentence each, or a table below its title."""
        if self.title:
            return Table([self.title[:1].upper() + self.title[1:], ""], self.rows, text_columns=2, kind="pairs").html
        return "".join(f"<p>{escape(name)}: {escape(signs(text))}.</p>\n" for name, text in self.rows)


@dataclass(frozen=True)
class Cards:
    """The numbers that count, each with a few words; on a page alone."""

    rows: Sequence[tuple[str, str]]

    @property
    def html(self) -> str:
        """It on a page."""
        return cards([(escape(signs(value)), escape(words)) for value, words in self.rows])


@dataclass(frozen=True)
class Picture:
    """A picture of one or more pages with words below it; drawn when a page is made, and on a page alone.

    Parameters
    ----------
    drawn : callable
        Returns its pages.
    words : str
        HTML.
    wide : bool
    """

    drawn: Callable[[], Sequence[Figure]]
    words: str
    wide: bool = False

    @property
    def html(self) -> str:
        """It on a page."""
        from servotwin.look.style import to_bytes

        return figure([picture(to_bytes(each, "svg"), self.words, kind="drawing") for each in self.drawn()], self.words,
                      kind="wide" if self.wide else "")


@dataclass(frozen=True)
class Beside:
    """Pictures that are files beside the page, with words below them; on a page alone."""

    names: Sequence[str]
    words: str
    kind: str = "wide"

    @property
    def html(self) -> str:
        """It on a page."""
        return figure([f'<img src="{name}" alt="{escape(self.words)}">' for name in self.names], escape(self.words),
                      kind=self.kind)


@dataclass(frozen=True)
class Html:
    """A part that only a page shows."""

    html: str


Part = str | Table | Pairs | Cards | Picture | Beside | Html


@dataclass(frozen=True)
class Section:
    """A part of a report under a title of a level of HTML; an empty one: no title. `key` is its address on a page."""

    title: str
    parts: Sequence[Part]
    level: int = 2
    key: str = ""

    @property
    def html(self) -> str:
        """Its parts on a page."""
        return "".join(f"<p>{escape(part)}</p>\n" if isinstance(part, str) else part.html for part in self.parts)


@dataclass(frozen=True)
class Report:
    """A result in words, tables and pictures.

    Parameters
    ----------
    title : str
    lead : str
        HTML below the title, on a page alone.
    sections : sequence of Section
        A part that is a text is a paragraph.
    remarks : sequence of str
        Remarks that come first.
    style : str
        Further CSS of its page.
    contents : bool
        Whether the page begins with a list of its sections.

    Examples
    --------
    >>> report = Report("a servo", "", [Section("Angles", [Table(["joint", "rms"], [["elbow", "-1 deg"]])])])
    >>> "−1°" in report.page, [type(part).__name__ for part in report.parts()]
    (True, ['Table'])
    """

    title: str
    lead: str
    sections: Sequence[Section]
    remarks: Sequence[str] = ()
    style: str = ""
    contents: bool = False

    def parts(self) -> Iterator[str | Table | Pairs]:
        """Give the parts that a terminal can show, in order."""
        for section in self.sections:
            for part in section.parts:
                if isinstance(part, str | Table | Pairs):
                    yield part

    @property
    def page(self) -> str:
        """The page of HTML, which needs nothing but itself."""
        lead = f'<p class="lead">{self.lead}</p>\n' if self.lead else ""
        body = chapters(self.sections) if self.contents else report_html(self.sections)
        return document(self.title, f"<h1>{escape(self.title)}</h1>\n{lead}{notes(self.remarks)}{body}",
                        style=self.style)


def report_html(sections: Sequence[Section]) -> str:
    """Return sections as HTML, for a page that has more."""
    return "".join((f"<h{section.level}>{escape(section.title)}</h{section.level}>\n" if section.title else "")
                   + section.html for section in sections)


def chapters(sections: Sequence[Section]) -> str:
    """Return long sections, each with a key, as HTML with a list of contents above them."""
    contents = "".join(f'<li><a href="#{each.key}">{escape(each.title)}</a></li>' for each in sections)
    return f'<nav aria-label="Contents"><ol>{contents}</ol></nav>\n' + "".join(
        f'<section id="{each.key}"><h2>{escape(each.title)}</h2>\n{each.html}</section>\n' for each in sections)


def cards(rows: Sequence[tuple[str, str]]) -> str:
    """Return the numbers that count, each with its words, as HTML of HTML."""
    return '<ul class="numbers">' + "".join(f"<li><b>{value}</b>{words}</li>" for value, words in rows) + "</ul>\n"


def notes(texts: Sequence[str]) -> str:
    """Return a box with sentences, as HTML of plain text; nothing without any."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<div class="note"><ul>{items}</ul></div>\n' if items else ""


def figure(images: Sequence[str], words: str, *, kind: str = "") -> str:
    """Return images, one below the other, with words below them, as HTML of HTML."""
    of_kind = f' class="{kind}"' if kind else ""
    return f"<figure{of_kind}><div>{''.join(images)}</div><figcaption>{words}</figcaption></figure>\n"


def signs(text: str) -> str:
    """Return a text of a terminal with the signs that a page can show; words keep their hyphens.

    Examples
    --------
    >>> signs("-3 +/- 2 deg"), signs("xl330-m288: --contact"), signs("1e-3"), signs("-"), signs("25 deg C")
    ('−3 ± 2°', 'xl330-m288: --contact', '1e−3', '–', '25 °C')
    """
    if text == "-":
        return "–"
    text = re.sub(r"(?<=\d) deg(?= C\b)", " °", text).replace("° C", "°C")
    text = re.sub(r"(?<=\d) us\b", " µs", re.sub(r"(?<=\d) deg\b", "°", text)).replace("+/-", "±")
    return re.sub(r"(?<![\w-])-(?=[\d.])|(?<=\de)-(?=\d)", MINUS, text)

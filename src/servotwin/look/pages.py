"""Pictures of more than one of them can show: pages, as even as possible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from servotwin.errors import InputError

Item = TypeVar("Item")


def pages(count: int, most: int) -> range:
    """Return the numbers, from 1 on, of the pages on which a picture shows `count` things, at most `most` on each.

    Of nothing there is one page.

    Examples
    --------
    >>> [len(pages(count, 12)) for count in (0, 1, 12, 13, 47)], pages(47, 12)[-1]
    ([1, 1, 1, 2, 4], 4)
    """
    return range(1, max(-(-count // most), 1) + 1)


def on_page(what: str, items: Sequence[Item], most: int, page: int) -> tuple[Sequence[Item], str]:
    """Return what a page shows of some things, and the words that say which of several pages it is.

    Parameters
    ----------
    what : str
        For messages.
    items : sequence
        All of them; pages take them in their order, and none has two more than another.
    most : int
        That a page shows.
    page : int
        One of the `pages` of all of them.

    Raises
    ------
    InputError
        If there is nothing to show, or no such page.

    Examples
    --------
    >>> on_page("letters", "abcde", 2, 2), on_page("letters", "abcde", 5, 1)
    (('bc', 'page 2 of 3'), ('abcde', ''))
    """
    if not items:
        raise InputError(f"{what} in a picture", got="none", allowed="at least one")
    last = pages(len(items), most)[-1]
    if not (isinstance(page, int) and 1 <= page <= last):
        raise InputError(f"page of {len(items)} {what}", got=page, allowed=f"1 to {last}")
    return part(items, page, last), f"page {page} of {last}" if last > 1 else ""


def part(items: Sequence[Item], page: int, last: int) -> Sequence[Item]:
    """Return what a page shows where `last` is the last one.

    Examples
    --------
    >>> [part("abcde", page, 3) for page in (1, 2, 3)]
    ['a', 'bc', 'de']
    """
    return items[len(items) * (page - 1) // last:len(items) * page // last]

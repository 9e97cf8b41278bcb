"""What servos at joints remember, and where they and the engine keep it."""

from __future__ import annotations

from servotwin.simulation.compile import joint_places as place
from servotwin.simulation.compile.addresses import Numbers, Words, copied, halves, numbers, told, words
from servotwin.simulation.compile.joints_layout import ASK_NEW, WELL


def word_at(base: int, offset: int) -> int:
    """Return the word that stands so many bytes behind an address."""
    return int(words(base + offset, 1)[0])


def number_at(base: int, offset: int) -> float:
    """Return the number that stands so many bytes behind an address."""
    return float(numbers(base + offset, 1)[0])


def engine_numbers(d: int, offset: int, count: int) -> Numbers:
    """Return an array of the engine's data whose address stands so many bytes behind its beginning."""
    return numbers(word_at(d, offset), count)


def moved(own: int, kept: int, size: int, back: bool) -> int:
    """Copy so many bytes from one address to another, or `back`; return how many they take there."""
    to, of = own if back else kept, kept if back else own
    if size == place.WORD:  # of a lane in a tile, one of many
        words(to, 1)[0] = words(of, 1)[0]
    else:
        copied(to, of, size)
    return place.WORD * ((size + place.WORD - 1) // place.WORD)


def memories(instance: Words, kept: int, back: bool) -> None:
    """Copy what all servos remember to an address, or `back`."""
    groups = words(instance[place.GROUPS], instance[place.COUNT])
    for k in range(instance[place.COUNT]):
        group = words(groups[k], place.GROUP_WORDS)
        pieces = words(group[place.PIECES], place.PIECE_WORDS * group[place.PIECE_COUNT])
        for n in range(group[place.PIECE_COUNT]):
            address, rows, stride, size = pieces[4 * n], pieces[4 * n + 1], pieces[4 * n + 2], pieces[4 * n + 3]
            for row in range(rows):
                kept += moved(address + row * stride, kept, size, back)


def instance_at(m: int, d: int, drive: Words) -> int:
    """Return the address of the servos in this data, which Python makes where it is new; 0: it could not."""
    count = word_at(drive[place.INSTANCES], 0)
    known = words(drive[place.INSTANCES] + place.WORD, 2 * count)
    for k in range(count):
        if known[2 * k] == d:
            return int(known[2 * k + 1])
    return told(drive[place.ASK], ASK_NEW, m, d)


def is_own(m: int, drive: Words) -> bool:
    """Tell whether a model is one of those that the servos are for, by its numbers of coordinates."""
    if drive[place.WIDE] != 0:
        return bool(word_at(m, 0) == drive[place.COORDINATES] and word_at(m, place.WORD) == drive[place.DOFS])
    sizes = halves(m, 2)
    return bool(sizes[0] == drive[place.COORDINATES] and sizes[1] == drive[place.DOFS])


def complain(instance: Words, code: int, culprit: int) -> None:
    """Keep what went wrong first."""
    if instance[place.CODE] == WELL:
        instance[place.CODE], instance[place.CULPRIT] = code, culprit

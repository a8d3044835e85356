"""Mutants: what damage, carelessness and malice make of a file. The same number gives the same mutant."""

from __future__ import annotations

import random
import re

__all__ = ["HOSTILE", "mutated"]

HOSTILE = [
    *("0", "-1", "1", "255", "65536", "4294967295", "-2147483649", "9007199254740993", "1e3", "1e9", "1e38", "1e39"),
    *("1e308", "-1e308", "1e400", "1e-400", "nan", "-inf", "inf", "NaN", "Infinity", "true", "null", '""', "[]", "{}"),
    *("9" * 400, "-" + "9" * 5000, "0." + "0" * 5000 + "1", "1" * 4300 + ".0", '"' + "x" * 5000 + '"'),
    *("[" * 500, "{ a = " * 300, "[[1, 2], [3]]", "[1e400, 0, 0]", "[nan, 0, 0]", "[1, 2]", "[0, 0, 0]"),
    *('"\\u001b[31m\\u0007"', '"\\u0000"', '"a\\nb"', '"\\u202e"', '"../../x"', '"/dev/zero"', '"' + "a/" * 3000 + '"'),
    *('"' + "n" * 300 + '"', '"$HOME/${PATH}"', '"~nobody_here/x"', "1979-05-27T07:32:00Z", "0x7fffffffffffffffff"),
]
"""Values for keys of a text, as TOML or JSON has them."""

_VALUE = re.compile(rb"(?<=[=:\[, ])\s*(-?[0-9][0-9.eE+-]*|\"[^\"\n]*\"|true|false|null|\[[^\[\]\n]*\])")
_LONGEST = 1 << 20


def mutated(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """A content with one to four things changed, at most a megabyte more.

    Parameters
    ----------
    content
        Of a file that is good.
    others
        Contents of which pieces may get into it.
    chance
        Decides all.
    """
    data = bytearray(content)
    text = content.isascii()
    for _ in range(chance.choice((1, 1, 1, 2, 3, 4))):
        # Most other damage of a text is a fault of its grammar, which tells little.
        if text and chance.random() < 0.7:
            _change_value(data, chance)
        else:
            _change(data, others, chance)
        del data[len(content) + _LONGEST :]
    return bytes(data)


def _change(data: bytearray, others: list[bytes], chance: random.Random) -> None:
    place = chance.randrange(len(data) + 1)
    # Headers are short and decide most.
    if chance.random() < 0.4:
        place = min(place, chance.randrange(64))
    length = min(chance.choice((1, 2, 4, 8, 64, 1000)), len(data) - place)
    match chance.randrange(11):
        case 0 if place < len(data):
            data[place] ^= 1 << chance.randrange(8)
        case 1 if place < len(data):
            data[place] = chance.choice((0, 1, 127, 128, 255, 10, 32, 34))
        case 2:
            width = chance.choice((1, 2, 4, 8))
            value = chance.choice((0, 1, 127, 255, 65535, 1 << 20, 1 << 24, 1 << 26, 1 << 31, (1 << 64) - 1))
            data[place : place + width] = (value % (1 << 8 * width)).to_bytes(width, chance.choice(("little", "big")))
        case 3:
            del data[place : place + length]
        case 4:
            data[place:place] = data[place : place + length] * chance.choice((1, 2, 100))
        case 5:
            del data[place:]
        case 6:
            other = chance.choice(others)
            start = chance.randrange(len(other) + 1)
            data[place : place + length] = other[start : start + length]
        case 7:
            data[place : place + length] = bytes(chance.randrange(256) for _ in range(length))
        case 8:
            lines = bytes(data).split(b"\n")
            line = chance.randrange(len(lines))
            lines[line : line + 1] = chance.choice(([], [lines[line]] * 2, [lines[line], chance.choice(lines)]))
            data[:] = b"\n".join(lines)
        case _:
            _change_value(data, chance)


def _change_value(data: bytearray, chance: random.Random) -> None:
    """Replace one value of a text by a hostile one, by another one of the text, or by one a little beside it."""
    values = list(_VALUE.finditer(bytes(data[: 1 << 16])))
    if not values:
        return
    found = chance.choice(values)
    new = chance.choice(HOSTILE).encode()
    if chance.random() < 0.5:
        new = chance.choice(values)[1]
    elif found[1][:1].isdigit() and len(found[1]) < 20 and chance.random() < 0.5:
        factor = chance.choice((b"e-300", b"e-30", b"e-3", b"e2", b"e5", b"e30", b"e300"))
        new = found[1].split(b"e")[0] + factor
    data[found.start(1) : found.end(1)] = new

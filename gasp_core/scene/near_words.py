"""What a word that is not known was probably meant to be."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["did_you_mean"]


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """The end of a message, ``, did you mean "..."?``, where one of the known words is near; else nothing.

    An axis without a sign is the positive one.
    """
    if not isinstance(word, str):
        return ""
    words = list(known)
    signed = f"+{word}"
    close = [signed] if signed in words else difflib.get_close_matches(word, words, n=1)
    return f', did you mean "{close[0]}"?' if close else ""

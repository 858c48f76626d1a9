# SPDX-License-Identifier: MIT
"""Units of a record, and what the names of a CSV file's columns say of them.

Names are read as people write them: ``acceleration_m_s2``, ``Acceleration (m/s²)``, ``acc [g]``.
One that names no unit, such as ``acceleration`` or ``a_g`` (of the ground), says nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from fenics_hytf.motion.records import GRAVITY

UNITS = {"g": GRAVITY, "m/s2": 1.0}
"""Factor from each unit that a CSV file may use to m/s^2."""

_SQUARED = r"(?:[/_. ]?s[_ ]?-?2|[/_. ]s[/_. ]s|ps2|[_ ]per[_ ]s2)"  # over s², s/s, in words
_OTHER_LENGTH = r"(?:km|dm|cm|mm|ft|in)"
_ENDS_IN_G = re.compile(r"(?:(?:.*[^a-z])?acc[a-z.]*[_ /]+(?:in )?)?(m?g'?s?)")
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]")
_WRITTEN_OTHERWISE = str.maketrans({"²": "2", "⁻": "-", "·": ".", "^": None, "*": None})

_LONGEST = 200  # characters of a name that are looked at: what is longer is no name

_UNIT = {"m/s2": re.compile(rf"m{_SQUARED}"), "g": re.compile(r"g'?s?")}
_REFUSED = {
    "divide the values by 100 and say m/s2": re.compile(rf"cm{_SQUARED}|gals?"),
    "convert the values and say in which of the two": re.compile(
        rf"{_OTHER_LENGTH}{_SQUARED}|mgals?|(?:m|milli-?|% ?)g'?s?|counts?"
    ),
    "differentiate the values once": re.compile(rf"(?:m|{_OTHER_LENGTH})[/_. ]s|kine"),
    "differentiate the values twice": re.compile(r"m|dm|cm|mm|ft|in"),
}
_OTHER_MOTION = re.compile(r"(?<![a-z])(?:vel|disp)")
_OTHER_TIME = re.compile(r"m(illi-?)?s(ec(onds?)?)?|[uµμ]s|min(utes?)?|h(ours?)?|hz")
_NO_TIME = re.compile(r"(?:samples?|index|freq[a-z]*|periods?)(?![a-z])")
_TIME = re.compile(r"t(?:ime)?[_ ]*(?:(?:in )?m?s(?:ec)?|\([^()]*\)|\[[^\[\]]*\])?")


class UnitError(ValueError):
    """A column of something else than what is read; the text says what to do."""


def acceleration_unit(name: str) -> str | None:
    """The unit that the name of a column of accelerations states.

    Args:
        name: The name.

    Returns:
        A key of :data:`UNITS`, or ``None`` if the name states no unit.

    Raises:
        UnitError: If it states another unit, or names no acceleration.
    """
    text = _plain(name)
    # without brackets one letter or two may be an index or an axis: a_g, acc_in, in
    words = list(_candidates(text, shortest=3))
    in_g = _ENDS_IN_G.fullmatch(text)
    if in_g:
        words.append(in_g[1])
    for unit, pattern in _UNIT.items():
        if any(pattern.fullmatch(word) for word in words):
            return unit
    for advice, pattern in _REFUSED.items():
        if any(pattern.fullmatch(word) for word in words):
            raise UnitError(advice)
    if _OTHER_MOTION.search(text) and "acc" not in text:
        raise UnitError("give accelerations instead")
    return None


def check_time(name: str) -> None:
    """Refuse the name of a column of times that are not in seconds, or of no times.

    Args:
        name: The name.

    Raises:
        UnitError: If it is one.
    """
    text = _plain(name)
    if _NO_TIME.match(text) or any(_OTHER_TIME.fullmatch(word) for word in _candidates(text)):
        raise UnitError("give the times in s, or the accelerations alone and dt")


def names_time(name: str) -> bool:
    """Whether this is how a column of times is called, and no other text."""
    return _TIME.fullmatch(_plain(name)) is not None


def _plain(name: str) -> str:
    """A name in one way of writing; a byte that is not UTF-8 after s is the ² of Latin 1."""
    text = (
        name.strip(' "')[:_LONGEST].lower().translate(_WRITTEN_OTHERWISE).replace("s\ufffd", "s2")
    )
    return re.sub(r"(?<![a-z])sec(?:onds?)?(?=[^a-z]|$)", "s", text)


def _candidates(text: str, shortest: int = 1) -> Iterator[str]:
    """Where a unit may stand: in brackets; else the whole or what follows a ``_`` or a space."""
    in_brackets = _BRACKETS.findall(text)
    if in_brackets:
        yield from map(str.strip, in_brackets)
        return
    for cut in re.finditer("^|[_ ]", text):
        if len(text) - cut.end() >= shortest:
            yield text[cut.end() :]

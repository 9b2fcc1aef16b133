"""Text files as they come: with or without byte-order mark, UTF-8 or UTF-16; and how their cells are separated."""

from __future__ import annotations

import codecs
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import InputError

_MARKS = (  # UTF-32's mark begins with that of UTF-16
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_HEAD = 64
_DIGITS = frozenset("0123456789")


class Layout(NamedTuple):
    """How a line is cut: at `separator` (empty: at blanks), and whether a comma is a decimal point."""

    separator: str
    decimal_comma: bool

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line without blanks around them; a separator at the end begins no cell."""
        if not self.separator:
            found = line.split()
        elif '"' in line:
            found = [cell.strip() for cell in next(csv.reader([line], delimiter=self.separator, skipinitialspace=True))]
        else:
            found = [cell.strip() for cell in line.split(self.separator)]
        while found and not found[-1]:
            found.pop()
        return found


def read_text(path: Path, *, strict: bool = False) -> str:
    """Return the text of a file: by its byte-order mark, else UTF-8, or UTF-16 where each second byte is zero.

    Args:
        path: the file.
        strict: refuse what is no text, instead of putting a replacement where a character cannot be read.

    Raises:
        InputError: the file is missing or not readable, or no text.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    try:
        text = data.decode(_encoding(data), errors="strict" if strict else "replace")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path}: it is no text; UTF-8 or UTF-16 was wanted")
    return text


def layout_of(path: Path, lines: Sequence[str], columns: int) -> Layout:
    """Return how lines of numbers are cut into at least `columns` cells.

    Semicolons separate wherever they stand. Commas separate, unless blanks or tabs already do and the commas stand inside the
    numbers: then they are decimal. A file with decimal commas must have no decimal points.

    Raises:
        InputError: points and commas are mixed.
    """
    sample = "\n".join(lines)
    if ";" in sample:
        return Layout(";", _decimal_comma(path, sample))
    if "," in sample:
        if not all(_commas_inside(line, columns) for line in lines):
            return Layout(",", decimal_comma=False)
        return Layout("", _decimal_comma(path, sample))
    return Layout("", decimal_comma=False)


def is_number(cell: str) -> bool:
    """Return whether a cell begins as a number does, NaN and infinity among them."""
    bare = cell.lstrip("+-").lower()
    return (
        bare[:1] in _DIGITS or (bare[:1] in (".", ",") and bare[1:2] in _DIGITS) or bare in ("nan", "inf", "infinity")
    )


def _encoding(data: bytes) -> str:
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    head = data[:_HEAD]
    if len(head) > 3 and 0 in head:
        if not any(head[0::2]):
            return "utf-16-be"
        if not any(head[1::2]):
            return "utf-16-le"
    return "utf-8"


def _commas_inside(line: str, columns: int) -> bool:
    words = line.split()
    return len(words) >= columns and all(
        word.count(",") < 2 and not word.startswith(",") and not word.endswith(",") for word in words
    )


def _decimal_comma(path: Path, sample: str) -> bool:
    comma = "," in sample
    if comma and any(left in _DIGITS and right in _DIGITS for left, right in _around_points(sample)):
        raise InputError(
            f"{path}: its numbers have both commas and points: it cannot be told which is the decimal point; "
            "numbers like 1234.5, without separators of thousands, were wanted"
        )
    return comma


def _around_points(sample: str) -> list[tuple[str, str]]:
    return [(sample[at - 1], sample[at + 1]) for at in range(1, len(sample) - 1) if sample[at] == "."]

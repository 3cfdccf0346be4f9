"""The cells of an Excel sheet (Office Open XML, ISO/IEC 29500-1 section 18.3) as lines of text."""

import re
import zipfile
from pathlib import Path
from typing import IO
from xml.etree.ElementTree import Element, ParseError, iterparse

from gcode2krl.errors import input_error

_MOST_BYTES = 2_000_000_000
"""Of one part when unpacked: a sheet of 1,048,576 rows and 20 columns has about one."""

_DAMAGED = (zipfile.BadZipFile, ParseError, KeyError, ValueError, IndexError, OSError, NotImplementedError)


def lines_of_sheets(path: Path) -> list[list[str]]:
    """Return of each sheet its rows with cells separated by tabs; dates are days since 1899-12-30.

    Raises `NotUnderstoodError`: no Excel file, damaged.
    """
    try:
        with zipfile.ZipFile(path) as book:
            parts = [re.fullmatch(r"xl/worksheets/sheet(\d+)\.xml", name) for name in book.namelist()]
            sheets = [part[0] for part in sorted(filter(None, parts), key=lambda part: int(part[1]))]
            if any(book.getinfo(name).file_size > _MOST_BYTES for name in sheets):
                words = "a sheet of more than 2 GB"
                raise input_error("trace-unreadable", words, "cut it to the run", source=str(path))
            shared = _shared_words(book)
            return [_lines(book.open(name), shared) for name in sheets]
    except _DAMAGED as error:
        text = f"not an Excel sheet, or a damaged one: {type(error).__name__}"
        raise input_error("trace-unreadable", text, "save it as CSV", source=str(path)) from None


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _shared_words(book: zipfile.ZipFile) -> list[str]:
    """Return the texts that cells refer to by number."""
    if "xl/sharedStrings.xml" not in book.namelist():
        return []
    texts = []
    for _, element in iterparse(book.open("xl/sharedStrings.xml")):
        if _tag(element) == "si":
            texts.append("".join(part.text or "" for part in element.iter() if _tag(part) == "t"))
            element.clear()
    return texts


def _lines(stream: IO[bytes], words: list[str]) -> list[str]:
    lines = []
    for _, element in iterparse(stream):
        if _tag(element) == "row":
            cells: dict[int, str] = {}
            for position, cell in enumerate(element):
                cells[_column(cell.get("r", ""), position)] = _value(cell, words)
            lines.append("\t".join(cells.get(k, "") for k in range(max(cells, default=-1) + 1)))
            element.clear()  # a sheet is larger than its numbers
    return lines


def _column(place: str, position: int) -> int:
    """Return the column of ``AB12``, from 0; a cell without a place follows the one before."""
    letters = re.match(r"[A-Z]{1,3}", place)
    if letters is None:
        return position
    number = 0
    for letter in letters[0]:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


def _value(cell: Element, words: list[str]) -> str:
    text = "".join(part.text or "" for part in cell.iter() if _tag(part) in ("v", "t"))
    value = words[int(text)] if cell.get("t") == "s" and text else text
    return re.sub(r"[\t\r\n]+", " ", value)

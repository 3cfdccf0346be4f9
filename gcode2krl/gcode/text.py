"""The text of a program: whole lines in pieces of bounded memory, unpacked where the file is gzip.

What is no text of a program (UTF-16, a picture, lines without an end) is refused with one sentence.
"""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.gcode.vocabulary import LINE_LIMIT

_PIECE_BYTES = 1_000_000
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_JUDGED_BYTES = 64
_GZIP = b"\x1f\x8b"
_MOST_TIMES = 100
"""A program shrinks to a tenth, the most regular one to a hundredth; zeros shrink to a thousandth."""
_UNJUDGED_BYTES = 20_000_000
"""So much may come out of a packed file before it is judged by how much it grew."""
_GZIP_WINDOW = 16 + zlib.MAX_WBITS
"""What zlib calls a stream with gzip's head and its check at the end."""


def pieces(stream: BinaryIO, name: str) -> Iterator[tuple[int, bytes]]:
    """Yield (first line, whole lines) with bounded memory, whatever the file holds.

    Raises `NotUnderstoodError` where it is empty, no text, or a gzip file that is cut off, damaged, or grows
    as no program does.
    """
    line, unfinished, first = 1, b"", True
    for block in _blocks(stream, name):
        if first:
            first = False
            block = block.removeprefix(_BYTE_ORDER_MARK)
            if len(block) < _PIECE_BYTES and not block.strip():
                raise input_error("empty", "the file is empty", "export the program again", source=name)
            _reject_binary(block, name)
            _reject_lone_returns(block, name)
        at_end = not block
        text = unfinished + (block if not at_end or not unfinished else b"\n")
        end = text.rfind(b"\n") + 1
        if len(text) - end > LINE_LIMIT:
            place = line + text.count(b"\n")
            raise input_error(
                "line-too-long",
                f"the line is longer than {LINE_LIMIT} characters",
                "is this a G-code file?",
                line=place,
                source=name,
            )
        if end:
            whole = text[:end]
            yield line, whole
            line += _line_count(whole)
        unfinished = text[end:]


def beginning(path: str | Path, name: str, most_bytes: int) -> bytes:
    """Return the first bytes of a program's text, unpacked; empty where it is no text."""
    try:
        with Path(path).open("rb") as stream:
            return next((text for _, text in pieces(stream, name)), b"")[:most_bytes]
    except (NotUnderstoodError, OSError):
        return b""


def _blocks(stream: BinaryIO, name: str) -> Iterator[bytes]:
    """Yield the bytes of a file, unpacked where it is gzip, and an empty block at its end."""
    block = stream.read(_PIECE_BYTES)
    if block.startswith(_GZIP):
        yield from _unpacked(block, stream, name)
        return
    while block:
        yield block
        block = stream.read(_PIECE_BYTES)
    yield b""


def _unpacked(packed: bytes, stream: BinaryIO, name: str) -> Iterator[bytes]:
    """Yield the text of all members of a gzip file that begins with ``packed``, then an empty block."""
    member, read_bytes, grown_bytes = zlib.decompressobj(_GZIP_WINDOW), len(packed), 0
    while packed:
        try:
            block = member.decompress(packed, _PIECE_BYTES)
        except zlib.error:
            raise _bad_gzip("the gzip file is damaged", "pack or copy the file again", name) from None
        grown_bytes += len(block)
        if grown_bytes > max(_UNJUDGED_BYTES, _MOST_TIMES * read_bytes):
            what = f"the gzip file grows to more than {_MOST_TIMES} times its size, as no program does"
            raise _bad_gzip(what, "unpack it by hand and look what it holds", name)
        if block:
            yield block
        packed = member.unconsumed_tail
        if member.eof and member.unused_data.strip(b"\0"):
            packed, member = member.unused_data, zlib.decompressobj(_GZIP_WINDOW)
        if not packed:
            packed = stream.read(_PIECE_BYTES)
            read_bytes += len(packed)
    if not member.eof:
        raise _bad_gzip("the gzip file is cut off: its end is missing", "copy the file again", name)
    yield b""


def _bad_gzip(what: str, remedy: str, name: str) -> NotUnderstoodError:
    return input_error("gzip-damaged", what, remedy, source=name)


def _line_count(text: bytes) -> int:
    """Return the number of line ends; for lines as short as these `bytes.count` takes five times as long."""
    return int(np.count_nonzero(np.frombuffer(text, np.uint8) == ord("\n")))


def _reject_binary(block: bytes, name: str) -> None:
    place = block[:65536].find(b"\x00")
    if place >= 0 and (block[:2] in (b"\xff\xfe", b"\xfe\xff") or _has_double_bytes(block)):
        what = "this file is text in UTF-16, two bytes a character"
        raise input_error("binary-file", what, "save it as UTF-8 or ASCII", line=1, source=name)
    if place >= 0:
        line = 1 + block.count(b"\n", 0, place)
        what = f"this is not a text file: byte {place + 1} is NUL"
        raise input_error("binary-file", what, "export the program as text", line=line, source=name)


def _has_double_bytes(block: bytes) -> bool:
    """Tell whether every second of the first bytes is NUL, as in UTF-16 without its mark."""
    head = block[:_JUDGED_BYTES]
    return any(not head[start::2].strip(b"\0") and b"\0" not in head[1 - start :: 2] for start in (0, 1))


def _reject_lone_returns(block: bytes, name: str) -> None:
    """Refuse line ends of one CR: the whole program would be one block."""
    if b"\n" not in block and block.rstrip().count(b"\r"):
        raise input_error(
            "line-ends",
            "the lines end in CR alone, so the whole file is one line",
            "save the program with line ends LF or CRLF",
            line=1,
            source=name,
        )

"""The bytes of a long text, which is written, measured and read back without being held as a whole."""

import contextlib
import mmap
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from gcode2krl.compiled.long_columns import note_mapped
from gcode2krl.files.output import naming_temporary_folder

SHORT_BYTES = 4 << 20
"""A text up to this is read into memory: a file that is mapped cannot be replaced meanwhile on Windows."""
_PIECE_BYTES = 1 << 20


class Stored:
    """A text in memory, or in a file that is read where it is looked at."""

    def __init__(self, source: bytes | Path | IO[bytes]) -> None:
        """Take the bytes, the place of a file, or an open one without a name."""
        self._source = source

    @property
    def size_bytes(self) -> int:
        """The length of the text."""
        if isinstance(self._source, bytes):
            return len(self._source)
        if isinstance(self._source, Path):
            return self._source.stat().st_size
        return self._source.seek(0, 2)

    @property
    def is_short(self) -> bool:
        """True where the text may be held in memory."""
        return self.size_bytes <= SHORT_BYTES

    def read(self) -> bytes:
        """Return the whole text."""
        return b"".join(self.pieces())

    def pieces(self) -> Iterator[bytes]:
        """Yield the text from its beginning, a part at a time."""
        if isinstance(self._source, bytes):
            yield self._source
            return
        with self._file(self._source) as file:
            file.seek(0)
            while piece := file.read(_PIECE_BYTES):
                yield piece

    @staticmethod
    def _file(source: Path | IO[bytes]) -> contextlib.AbstractContextManager[IO[bytes]]:
        return source.open("rb") if isinstance(source, Path) else contextlib.nullcontext(source)

    @contextlib.contextmanager
    def opened(self) -> Iterator[NDArray[np.uint8]]:
        """Return the bytes (n,), of a long file as they are looked at; no array of them may be kept."""
        if self.is_short or isinstance(self._source, bytes):
            yield np.frombuffer(self.read(), dtype=np.uint8)
            return
        with self._file(self._source) as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            note_mapped(mapped)
            try:
                yield np.frombuffer(mapped, dtype=np.uint8)
            finally:
                with contextlib.suppress(BufferError):  # an error that is on its way holds an array
                    mapped.close()


def whole_lines(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Yield a text in pieces that end with a line."""
    rest = b""
    for piece in pieces:
        end = piece.rfind(b"\n") + 1
        if end:
            yield rest + piece[:end]
            rest = b""
        rest += piece[end:]
    yield rest


def store(pieces: Iterable[bytes]) -> Stored:
    """Return a text that comes in pieces, a long one in a temporary file that vanishes with it."""
    held: list[bytes] = []
    size, file = 0, None
    for piece in pieces:
        size += len(piece)
        held.append(piece)
        if size > SHORT_BYTES:
            file = _written(held, file)
            size, held = 0, []
    return Stored(b"".join(held)) if file is None else Stored(_written(held, file))


def _written(pieces: list[bytes], file: IO[bytes] | None) -> IO[bytes]:
    """Add pieces to a temporary file, a new one where there is none."""
    with naming_temporary_folder():
        file = file if file is not None else tempfile.TemporaryFile()  # noqa: SIM115 - lives as the text
        file.writelines(pieces)
        file.flush()
    return file


class Texts(Mapping[str, bytes]):
    """File name → bytes, read where they are asked for."""

    def __init__(self, contents: Mapping[str, Stored]) -> None:
        """Take the texts."""
        self._contents = contents

    def __getitem__(self, name: str) -> bytes:
        return self._contents[name].read()

    def __iter__(self) -> Iterator[str]:
        return iter(self._contents)

    def __len__(self) -> int:
        return len(self._contents)

"""Texts that are not held as a whole, and columns in temporary files."""

import errno
import os
import tempfile

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.files import stored as module
from gcode2krl.files.spool import Spool
from gcode2krl.files.stored import Stored, Texts, store, whole_lines

TEXT = b"".join(b"LIN {X %d.000}\r\n" % k for k in range(500))


def pieces_of(text, size):
    return [text[k : k + size] for k in range(0, len(text), size)]


@pytest.fixture(params=["bytes", "file", "temporary", "short"])
def text(request, tmp_path, monkeypatch):
    """A text in each of its forms, all but the last longer than what is held."""
    monkeypatch.setattr(module, "_PIECE_BYTES", 700)
    if request.param != "short":
        monkeypatch.setattr(module, "SHORT_BYTES", 1000)
    if request.param == "bytes":
        return Stored(TEXT)
    if request.param == "file":
        (tmp_path / "a.src").write_bytes(TEXT)
        return Stored(tmp_path / "a.src")
    return store(pieces_of(TEXT, 64))


def test_every_form_says_the_same(text):
    assert text.size_bytes == len(TEXT)
    assert text.read() == TEXT
    assert b"".join(text.pieces()) == TEXT
    assert b"".join(text.pieces()) == TEXT, "it is read from its beginning each time"
    with text.opened() as data:
        assert data.tobytes() == TEXT
        del data
    assert Texts({"A.src": text}) == {"A.src": TEXT}


def test_a_file_that_was_open_can_be_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SHORT_BYTES", 0)
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_bytes(TEXT)
    with Stored(first).opened() as data:
        assert int(data[0]) == ord("L")
        mapped = data.base.obj
        del data
    assert mapped.closed
    first.replace(second)
    assert second.read_bytes() == TEXT


def test_an_empty_text(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SHORT_BYTES", 0)
    (tmp_path / "empty").write_bytes(b"")
    for text in (store([]), Stored(tmp_path / "empty")):
        assert (text.size_bytes, text.read()) == (0, b"")
        with text.opened() as data:
            assert len(data) == 0


@pytest.mark.parametrize("size", [1, 5, 17, 1000, 10**6])
@pytest.mark.parametrize("end", [b"", b"no end of line"])
def test_pieces_end_with_lines_and_nothing_is_lost(size, end):
    made = list(whole_lines(pieces_of(TEXT + end, size)))
    assert b"".join(made) == TEXT + end
    assert all(piece.endswith(b"\n") for piece in made[:-1])
    assert made[-1] == end


@pytest.mark.parametrize("write", [lambda: store([TEXT]), lambda: Spool(np.uint8).append(np.zeros(2 << 20))])
def test_a_full_temporary_folder_is_named(monkeypatch, write):
    monkeypatch.setattr(module, "SHORT_BYTES", 0)

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(NotUnderstoodError, match="No space left") as refused:
        write()
    assert refused.value.exit_code == 2
    assert tempfile.gettempdir() in str(refused.value)

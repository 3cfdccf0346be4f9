"""The scan of a program does not depend on the chunks that it is read in, nor on the number of threads."""

import random

import numpy as np
import pytest

from gcode2krl import krl_words as w
from gcode2krl.krl import scan

LINES = (
    b"\n",
    b"  \r\n",
    b"; comment\r\n",
    b";FOLD head\r\n",
    b";ENDFOLD\r\n",
    b"&ACCESS RVP\r\n",
    b"LIN {X 1.5,Y -2,Z 0.001,A 0,B 90,C -180} C_DIS\r\n",
    b"PTP {A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}\r\n",
    b"lin {x 1} ; short\n",
    b"LIN {X 1,X 2}\r\n",
    b"$VEL.CP=0.0166667\r\n",
    b"WAIT SEC 1.5 ; dwell\r\n",
    b"TRIGGER WHEN DISTANCE=0 DELAY=7 DO GK_PILOT=3\r\n",
    b"TRIGGER WHEN DISTANCE=1 DELAY=-7 DO GK_P(1,2,3,4) PRIO=-1\r\n",
    b"$OUT[1]=TRUE\r\n",
    b"; \xe9\r\n",
    b"; " + b"x" * w.LONGEST_LINE + b"\r\n",
)


def random_text(seed):
    chance = random.Random(seed)
    text = b"".join(chance.choice(LINES) for _ in range(chance.randint(0, 80)))
    return text[: chance.randint(0, len(text))] if chance.random() < 0.5 else text


def assert_same(found, expected):
    for name in ("kind", "line", "span", "blend", "too_long", "not_ascii", "open_folds"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    read = expected.kind != w.KIND_OTHER
    assert np.array_equal(found.value[read], expected.value[read], equal_nan=True)


@pytest.mark.parametrize("chunk_bytes", [0, 10, 300])
@pytest.mark.parametrize("threads", ["1", "3"])
def test_the_chunks_do_not_matter(chunk_bytes, threads, monkeypatch):
    texts = [random_text(seed) for seed in range(60)]
    whole = [scan.scan_krl(text) for text in texts]
    monkeypatch.setattr(scan, "CHUNK_BYTES", chunk_bytes)
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    for text, expected in zip(texts, whole, strict=True):
        assert_same(scan.scan_krl(text), expected)
    assert any(found.too_long and found.not_ascii and found.open_folds for found in whole)


@pytest.mark.parametrize("chunk_bytes", [0, 10, 1 << 20])
def test_statements_stand_where_the_scan_says(chunk_bytes, monkeypatch):
    monkeypatch.setattr(scan, "CHUNK_BYTES", chunk_bytes)
    text = b"".join(LINES)
    found = scan.scan_krl(text)
    lines = text.split(b"\n")
    for line, (first, last) in zip(found.line, found.span, strict=True):
        assert text[first:last] == lines[line - 1].strip()
    trigger = found.value[found.kind == w.KIND_TRIGGER][:, scan.NAME : scan.NAME + 2].astype(int)
    assert [text[first : first + size] for first, size in trigger] == [b"GK_PILOT", b"GK_P"]
    assert lines[found.not_ascii - 1] == b"; \xe9\r"
    assert len(lines[found.too_long - 1]) > w.LONGEST_LINE

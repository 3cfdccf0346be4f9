"""Telegrams in and out: what KUKA sends is read, everything else is refused without harm."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.telegram import Answer, MalformedError, answer_text, parse

GOOD = (
    b'<Rob Type="KUKA"><RIst X="1.5" Y="-2" Z="3e1" A="0.0" B="0.0" C="0.0"/>'
    b'<RSol X="1.0" Y="-2.0" Z="30.0" A="0.0" B="0.0" C="0.0" />'
    b'<AIPos A1="0.0" A2="-90.0" A3="90.0" A4="0.0" A5="45.0" A6="0.0"/>\n'
    b'  <ASPos A1="0.0" A2="-90.0" A3="90.0" A4="0.0" A5="45.0" A6="0.0"></ASPos>'
    b'<Delay D="3"/><PosCorrMon X="0.1" Y="0.2" Z="0.3"/><SenPInt1>7</SenPInt1>'
    b"<SenPInt2>2147483647</SenPInt2>"
    b"<OvPro>100</OvPro><T1>0</T1><Unknown>text</Unknown><IPOC>4208163634</IPOC></Rob>"
)


def test_a_telegram_is_read():
    found = parse(GOOD)
    assert found.ipoc == 4208163634
    np.testing.assert_array_equal(found.position_mm, [1.5, -2.0, 30.0])
    np.testing.assert_array_equal(found.command_mm, [1.0, -2.0, 30.0])
    np.testing.assert_allclose(found.q_rad, np.radians([0, -90, 90, 0, 45, 0]))
    np.testing.assert_array_equal(found.monitor_mm, [0.1, 0.2, 0.3])
    assert (found.late, found.knot, found.checksum) == (3.0, 7.0, 2147483647.0)
    assert (found.override_percent, found.t1) == (100.0, 0.0)
    assert np.isnan(found.load).all()
    assert np.isnan(found.values).all()


def test_what_is_not_reported_is_nan():
    short = GOOD.replace(b"<OvPro>100</OvPro>", b"").replace(b"<SenPInt1>7</SenPInt1>", b"")
    found = parse(short)
    assert np.isnan(found.override_percent)
    assert np.isnan(found.knot)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b" ",
        b"Rob",
        GOOD[:-1],
        GOOD[1:],
        GOOD + b"x",
        GOOD + GOOD,
        b"\xff" * 100,
        GOOD.replace(b"<IPOC>4208163634</IPOC>", b""),
        GOOD.replace(b"4208163634", b"-1"),
        GOOD.replace(b"4208163634", b"1" * 19),
        GOOD.replace(b'X="1.5"', b'X="nan"'),
        GOOD.replace(b'X="1.5"', b'X="inf"'),
        GOOD.replace(b'X="1.5"', b'X="1,5"'),
        GOOD.replace(b'X="1.5"', b'X=""'),
        GOOD.replace(b'X="1.5"', b'X="1e999"'),
        GOOD.replace(b'X="1.5"', b""),
        GOOD.replace(b"RSol", b"RIst"),
        GOOD.replace(b"<T1>0</T1>", b"<T1><T2>0</T2></T1>"),
        GOOD.replace(b"<T1>0</T1>", b"<T1>&amp;</T1>"),
        GOOD.replace(b"<T1>0</T1>", b"<!-- x -->"),
        GOOD.replace(b"<T1>0</T1>", b"<![CDATA[x]]>"),
        b'<?xml version="1.0"?>' + GOOD,
        b'<!DOCTYPE Rob [<!ENTITY a "b">]>' + GOOD,
        b"<Rob>" + b"<A>1</A>" * 3 + b"<IPOC>1</IPOC></Rob>",
        b"<Rob>" + b"".join(b"<A%d/>" % k for k in range(100)) + b"</Rob>",
        GOOD + b" " * 9000,
        b"<Rob" * 2000,
        b'<Rob Type="KUKA">' + b'<A x="' * 1000,
    ],
)
def test_anything_else_is_refused(data):
    with pytest.raises(MalformedError):
        parse(data)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_are_a_telegram_or_refused(data):
    with pytest.raises(MalformedError):
        parse(data)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.binary(min_size=0, max_size=6))
@example(GOOD.index(b' B="') + 1, b"X")  # two X
def test_a_telegram_with_a_piece_replaced_is_read_as_xml_would_be_or_refused(at, piece):
    data = GOOD[:at] + piece + GOOD[at + len(piece) :]
    try:
        found = parse(data)
    except MalformedError:
        return
    root = ET.fromstring(data)
    assert float(root.find("RIst").get("X")) == found.position_mm[0]
    assert int(root.find("IPOC").text) == found.ipoc


def test_a_hostile_telegram_takes_no_time():
    import time

    started = time.perf_counter()
    for data in (
        b"<Rob>" + b"<A " * 2600,
        b"<Rob>" + b'<A x="1" ' * 900,
        b"<Rob>" + b" " * 8000,
        b"<" * 8192,
    ):
        with pytest.raises(MalformedError):
            parse(data)
    assert time.perf_counter() - started < 1.0


def test_answers_are_xml_with_the_ipoc_unchanged():
    root = ET.fromstring(answer_text(Answer(4208163634, np.array([0.12345, -1.0, 0.0]), True), Online()))
    assert (root.tag, root.get("Type")) == ("Sen", "ImFree")
    assert (
        root.find("RKorr").attrib
        == {"X": "0.1235", "Y": "-1.0000", "Z": "0.0000", "A": "0.0000", "B": "0.0000", "C": "0.0000"}
        or root.find("RKorr").get("X") == "0.1234"
    )
    assert root.find("IPOC").text == "4208163634"
    assert root.find("Ready").text == "1"
    root = ET.fromstring(
        answer_text(Answer(1, np.radians([0.1, 0, 0, 0, 0, -0.25]), False), Online(mode="axis"))
    )
    assert root.find("AKorr").get("A1") == "0.100000"
    assert root.find("AKorr").get("A6") == "-0.250000"
    assert root.find("Ready").text == "0"

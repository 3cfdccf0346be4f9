"""The controller's files: limits on its side, channels that fit each other, and the lines of KRL."""

import re
import xml.etree.ElementTree as ET

import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.online.krl_files import (
    end_statements,
    ethernet_xml,
    file_names,
    lost_subprogram,
    signal_flow_xml,
    start_statements,
    used_variables,
)
from gcode2krl.online.settings import Online, RobotLink

FORMS = ["index", "values", "none"]
MODES = ["cartesian", "axis"]


def objects(own, form):
    root = ET.fromstring(signal_flow_xml(own, form, "X_ETH.xml").encode())
    return {one.get("ObjID"): one for one in root}


def parameters(one):
    return {p.get("Name"): p.get("ParamValue") for p in one.iter("Parameter")}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("form", FORMS)
def test_channels_of_both_files_fit(mode, form):
    own = Online(mode=mode)
    root = ET.fromstring(ethernet_xml(own, form))
    flow = objects(own, form)
    sent = [e for e in root.iter("ELEMENT") if e.get("HOLDON") is None and e.get("INDX") != "INTERNAL"]
    wires = list(flow["ETHERNET1"].iter("Input"))
    assert [int(e.get("INDX")) for e in sent] == list(range(1, len(wires) + 1))
    assert [int(w.get("InIdx")) for w in wires] == list(range(1, len(wires) + 1))
    assert all(w.get("OutObjID") in flow for w in wires)
    received = {int(e.get("INDX")): e.get("TAG") for e in root.iter("ELEMENT") if e.get("HOLDON")}
    wired = {
        (name, int(w.get("OutIdx"))) for name, one in flow.items() for w in one.iter("Input")
        if w.get("OutObjID") == "ETHERNET1"
    }  # fmt: skip
    assert {index for _, index in wired} == set(received)
    assert received[7] == "Ready"
    corrects = "POSCORR1" if mode == "cartesian" else "AXISCORR1"
    assert {(corrects, k) for k in range(1, 7)} <= wired


@pytest.mark.parametrize("mode", MODES)
def test_corrections_hold_and_readiness_falls(mode):
    root = ET.fromstring(ethernet_xml(Online(mode=mode), "index"))
    hold = {e.get("TAG"): e.get("HOLDON") for e in root.iter("ELEMENT") if e.get("HOLDON")}
    assert hold.pop("Ready") == "0"
    assert set(hold.values()) == {"1"}
    assert len(hold) == 6


def test_limits_stand_in_the_controllers_files_too():
    own = Online(most_mm=1.5)
    flow = objects(own, "index")
    limits = parameters(flow["POSCORR1"])
    for axis in "XYZ":
        assert float(limits[f"LowerLim{axis}"]) == -1.5
        assert float(limits[f"UpperLim{axis}"]) == 1.5
    assert limits["RefCorrSys"] == "1"
    assert 1.5 < float(parameters(flow["POSCORRMON1"])["MaxTrans"]) <= 1.5 * 1.25
    link = parameters(flow["ETHERNET1"])
    assert int(link["Timeout"]) <= 5
    assert link["ConfigFile"] == "X_ETH.xml"
    axis = Online(mode="axis")
    flow = objects(axis, "none")
    for k, most in enumerate(axis.axis_most_deg, start=1):
        assert float(parameters(flow["AXISCORR1"])[f"UpperLimA{k}"]) == most
        assert most < float(parameters(flow["AXISCORRMON1"])[f"MaxA{k}"]) <= 1.25 * most


def test_more_than_five_cycles_of_silence_cannot_be_asked_for():
    with pytest.raises(ValueError, match="timeout_cycles"):
        RobotLink(timeout_cycles=6)


def test_absolute_mode_only():
    for own, cycle in ((Online(), "#IPO_FAST"), (Online(cycle_s=0.012), "#IPO")):
        text = start_statements("GK_RSI", own)
        assert f"RSI_ON(#ABSOLUTE,{cycle})" in text
        assert "RELATIVE" not in text
        lines = text.splitlines()
        on = next(k for k, line in enumerate(lines) if "RSI_ON" in line)
        assert any("RSI_CREATE" in line for line in lines[:on])
        assert any(line.startswith("WAIT FOR $OUT[1020]") for line in lines[on:])


def test_every_call_of_rsi_is_checked():
    text = "\n".join((start_statements("A", Online()), end_statements()))
    calls = re.findall(r"GK_RSI_RET=RSI_(?:CREATE|ON|OFF)", text)
    assert len(calls) == 3
    assert text.count("IF GK_RSI_RET<>RSIOK THEN") == 3


def test_the_interrupt_stops_on_the_path_and_retracts_along_the_tool(cell):
    text = lost_subprogram(Online(), cell, 1).splitlines()
    assert text[0] == "DEF GK_RSI_LOST( )"
    assert text.index("BRAKE") < next(k for k, line in enumerate(text) if line.startswith("LIN_REL"))
    assert "LIN_REL {Z 50.000} #TOOL" in text
    tool = cell.tool[1].model_copy(update={"axis": "-x"})
    other = cell.model_copy(update={"tool": {1: tool}})
    assert "LIN_REL {X -50.000} #TOOL" in lost_subprogram(Online(), other, 1)


def test_texts_are_ascii_and_short(cell):
    for form in FORMS:
        for text in (
            ethernet_xml(Online(), form),
            signal_flow_xml(Online(), form, "A"),
            used_variables(Online(), cell, form),
        ):
            assert text.isascii()
    for text in (start_statements("A" * 16, Online()), end_statements(), lost_subprogram(Online(), cell, 1)):
        assert text.isascii()
        assert max(len(line) for line in text.splitlines()) < 100


@pytest.mark.parametrize("name", ["", "a b", "ä", "x" * 17, "a.b", "../a"])
def test_names_that_are_none_for_a_controller_are_refused(name):
    with pytest.raises(NotUnderstoodError, match="--online"):
        file_names(name)


def test_rsipi_reads_the_files_as_we_mean_them(tmp_path):
    """An independent reader of both files, where it is installed."""
    parser = pytest.importorskip("RSIPI.config_parser")
    limits = pytest.importorskip("RSIPI.rsi_limit_parser")
    (tmp_path / "e.xml").write_text(ethernet_xml(Online(), "index"))
    (tmp_path / "f.rsi.xml").write_text(signal_flow_xml(Online(), "index", "e.xml"))
    config = parser.ConfigParser(str(tmp_path / "e.xml"))
    assert set(config.receive_variables["RKorr"]) == set("XYZABC")
    assert limits.parse_ethernet_timeout(str(tmp_path / "f.rsi.xml")) == 5

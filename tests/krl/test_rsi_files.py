"""The controller's files: limits on its side, and channels that fit each other, the cell and the server."""

import xml.etree.ElementTree as ET

import pytest

from gcode2krl.cell import resolve_cell
from gcode2krl.cell.sections import Pilot
from gcode2krl.cell.sections.online import Online
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl.rsi_files import ethernet_xml, file_names, rsi_texts, signal_flow_xml

FORMS = ["index", "values", "none"]
MODES = ["cartesian", "axis"]


def objects(own, form, pilot=None):
    root = ET.fromstring(signal_flow_xml(own, pilot or Pilot(), form, "X_ETH.xml").encode())
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
        (name, int(w.get("OutIdx")))
        for name, one in flow.items()
        for w in one.iter("Input")
        if w.get("OutObjID") == "ETHERNET1"
    }
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


def test_both_files_say_what_the_cell_says():
    own = resolve_cell(
        {
            "based_on": "demonstration",
            "online": {
                "most_mm": 1.25,
                "link": {
                    "address": "192.168.7.3",
                    "port": 50123,
                    "sensor_type": "Mine",
                    "timeout_cycles": 3,
                    "decimals": 6,
                    "t1_output": 41,
                    "ready_output": 42,
                },
            },
            "pilot": {"index_variable": "$SEN_PINT[7]", "hash_variable": "$SEN_PINT[9]"},
        }
    )
    texts = rsi_texts("RSI_7", own.online, own.pilot, "index")
    assert list(texts) == ["RSI_7_ETH.xml", "RSI_7.rsi.xml"]
    config = ET.fromstring(texts["RSI_7_ETH.xml"]).find("CONFIG")
    assert {e.tag: e.text for e in config} == {
        "IP_NUMBER": "192.168.7.3",
        "PORT": "50123",
        "SENTYPE": "Mine",
        "ONLYSEND": "FALSE",
    }
    flow = {one.get("ObjID"): parameters(one) for one in ET.fromstring(texts["RSI_7.rsi.xml"].encode())}
    assert flow["ETHERNET1"] == {"ConfigFile": "RSI_7_ETH.xml", "Timeout": "3", "Precision": "6"}
    assert flow["DIGOUT1"]["Index"] == "41"
    assert flow["MAP2DIGOUT1"]["Index"] == "42"
    assert (flow["SEN_PINT1"]["Index"], flow["SEN_PINT2"]["Index"]) == ("7", "9")
    assert flow["POSCORR1"]["UpperLimX"] == "1.25"


@pytest.mark.parametrize(
    ("pilot", "form"),
    [
        ({"index_variable": "KNOT"}, "index"),
        ({"hash_variable": "SUM"}, "index"),
        ({"hash_variable": "SUM"}, "values"),
        ({"value_variable": "FORCE"}, "values"),
    ],
)
def test_a_variable_that_rsi_cannot_read_is_refused(pilot, form):
    with pytest.raises(RefusedError, match="online-pilot"):
        rsi_texts("A", Online(), Pilot(**pilot), form)
    assert rsi_texts("A", Online(), Pilot(**pilot), "none")


@pytest.mark.parametrize("form", FORMS)
def test_texts_are_ascii(form):
    assert all(text.isascii() for text in rsi_texts("A", Online(), Pilot(), form).values())


@pytest.mark.parametrize(
    "name", ["", "a b", "ä", "x" * 17, "a.b", "../a", "a\n", "CON", "lpt1", 'a"b', "a/b", "A²"]
)
def test_names_that_are_none_for_a_controller_are_refused(name):
    with pytest.raises(NotUnderstoodError, match="name of the RSI files"):
        file_names(name)


def test_rsipi_reads_the_files_as_we_mean_them(tmp_path):
    """An independent reader of both files, where it is installed."""
    parser = pytest.importorskip("RSIPI.config_parser")
    limits = pytest.importorskip("RSIPI.rsi_limit_parser")
    for file_name, text in rsi_texts("E", Online(), Pilot(), "index").items():
        (tmp_path / file_name).write_text(text)
    config = parser.ConfigParser(str(tmp_path / "E_ETH.xml"))
    assert set(config.receive_variables["RKorr"]) == set("XYZABC")
    assert limits.parse_ethernet_timeout(str(tmp_path / "E.rsi.xml")) == 5

"""The controller's files: limits on its side, and channels that fit each other, the cell and the server."""

import re
import xml.etree.ElementTree as ET

import pytest

from gcode2krl.cell import resolve_cell
from gcode2krl.cell.sections import Pilot
from gcode2krl.cell.sections.online import Online
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl.rsi_files import ethernet_xml, file_names, rsi_texts

FORMS = ["index", "values", "none"]
MODES = ["cartesian", "axis"]
VERSIONS = ["3", "4", "5"]

OF_RSI_VISUAL = {
    "3": {
        "ETHERNET": (64, {"ConfigFile": 1, "Timeout": 1, "Precision": 8}),
        "POSCORR": (
            27,
            {
                **{f"LowerLim{axis}": k for k, axis in enumerate("XYZ", start=1)},
                **{f"UpperLim{axis}": k for k, axis in enumerate("XYZ", start=4)},
                **{"MaxRotAngle": 7, "RefCorrSys": 1},
            },
        ),
        "POSCORRMON": (81, {"MaxTrans": 1, "MaxRotAngle": 2}),
        "AXISCORR": (
            33,
            {f"LowerLimA{k}": k for k in range(1, 7)} | {f"UpperLimA{k}": k + 12 for k in range(1, 7)},
        ),
        "AXISCORRMON": (82, {f"MaxA{k}": k for k in range(1, 7)}),
        "MAP2DIGOUT": (14, {"Index": 1, "DataSize": 2}),
        "DIGOUT": (43, {"Index": 1, "DataSize": 2}),
        "SEN_PINT": (57, {"Index": 1}),
        "SEN_PREA": (58, {"Index": 1}),
        "OV_PRO": (63, {}),
    },
    "4": {
        "Ethernet": (64, {"ConfigFile": 0, "Timeout": 0, "Precision": 7}),
        "PosCorr": (
            27,
            {
                **{f"LowerLim{axis}": k for k, axis in enumerate("XYZ")},
                **{f"UpperLim{axis}": k for k, axis in enumerate("XYZ", start=3)},
                **{"MaxRotAngle": 6, "RefCorrSys": 0},
            },
        ),
        "PosCorrMon": (81, {"MaxTrans": 0, "MaxRotAngle": 1}),
        "AxisCorr": (
            33,
            {f"LowerLimA{k}": k - 1 for k in range(1, 7)} | {f"UpperLimA{k}": k + 5 for k in range(1, 7)},
        ),
        "AxisCorrMon": (82, {f"MaxA{k}": k - 1 for k in range(1, 7)}),
        "Map2DigOut": (14, {"Index": 0, "DataType": 1}),
        "DigOut": (43, {"Index": 0, "DataType": 1}),
        "Sen_PInt": (57, {"Index": 0}),
        "Sen_PRea": (58, {"Index": 0}),
        "OV_PRO": (63, {}),
    },
}
"""Kind of object → its number, and the number of each parameter, as read in files that RSI Visual made:
for RSI 3 kuka_experimental and RSIPI, for 4.1 and 5.0, which agree, kuka-external-control-sdk and
kuka_rsi_driver."""
OF_RSI_VISUAL["5"] = OF_RSI_VISUAL["4"]


def objects(own, form, pilot=None, rsi="3"):
    """Return name → object; of a ``.rsix`` with its attributes as RSI 3 spells them."""
    texts = rsi_texts("X", own, pilot or Pilot(), form, rsi)
    text = next(text for name, text in texts.items() if not name.endswith("_ETH.xml"))
    if rsi != "3":
        text = re.sub(r' xmlns="\w+"', "", text).replace('Id="', 'ID="')
    found = {one.get("ObjID"): one for one in ET.fromstring(text.encode()).iter() if one.get("ObjID")}
    for wire in (wire for one in found.values() for wire in one.iter("Input") if rsi != "3"):
        for key in ("InIdx", "OutIdx"):  # of a .rsix from 0
            wire.set(key, str(int(wire.get(key)) + 1))
    return found


def parameters(one):
    return {p.get("Name"): p.get("ParamValue") for p in one.iter("Parameter")}


@pytest.mark.parametrize("rsi", VERSIONS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("form", FORMS)
def test_numbers_are_those_of_files_that_rsi_visual_made(rsi, mode, form):
    fixed = {"ConfigFile", "RefCorrSys"}
    for one in objects(Online(mode=mode), form, rsi=rsi).values():
        number, known = OF_RSI_VISUAL[rsi][one.get("ObjType")]
        assert int(one.get("ObjTypeID")) == number
        assert {p.get("Name"): int(p.get("ParamID")) for p in one.iter("Parameter")} == known
        assert {p.get("Name") for p in one.iter("Parameter") if p.get("IsRuntime") == "false"} <= fixed
        assert {p.get("Name") for p in one.iter("Parameter") if p.get("IsRuntime") is None} & fixed == set()


@pytest.mark.parametrize(
    ("rsi", "pilot", "link", "refused"),
    [
        ("3", {"index_variable": "$SEN_PINT[21]"}, {}, True),
        ("4", {"index_variable": "$SEN_PINT[21]"}, {}, False),
        ("3", {}, {"ready_output": 4097}, True),
        ("5", {}, {"ready_output": 4097}, False),
    ],
)
def test_an_index_that_the_version_has_not_is_refused(rsi, pilot, link, refused):
    own = Online.model_validate({"link": link})
    if not refused:
        assert rsi_texts("A", own, Pilot(**pilot), "index", rsi)
        return
    with pytest.raises(RefusedError, match="rsi-index"):
        rsi_texts("A", own, Pilot(**pilot), "index", rsi)


@pytest.mark.parametrize("rsi", VERSIONS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("form", FORMS)
def test_channels_of_both_files_fit(rsi, mode, form):
    own = Online(mode=mode)
    root = ET.fromstring(ethernet_xml(own, form))
    flow = objects(own, form, rsi=rsi)
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
    texts = rsi_texts("RSI_7", own.online, own.pilot, "index", "3")
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
        rsi_texts("A", Online(), Pilot(**pilot), form, "3")
    assert rsi_texts("A", Online(), Pilot(**pilot), "none", "3")


@pytest.mark.parametrize("rsi", VERSIONS)
@pytest.mark.parametrize("form", FORMS)
def test_texts_are_ascii(rsi, form):
    assert all(text.isascii() for text in rsi_texts("A", Online(), Pilot(), form, rsi).values())


@pytest.mark.parametrize(
    "name", ["", "a b", "ä", "x" * 17, "a.b", "../a", "a\n", "CON", "lpt1", 'a"b', "a/b", "A²"]
)
def test_names_that_are_none_for_a_controller_are_refused(name):
    with pytest.raises(NotUnderstoodError, match="name of the RSI files"):
        file_names(name, "3")


def test_rsipi_reads_the_files_as_we_mean_them(tmp_path):
    """An independent reader of both files, where it is installed."""
    parser = pytest.importorskip("RSIPI.config_parser")
    limits = pytest.importorskip("RSIPI.rsi_limit_parser")
    for file_name, text in rsi_texts("E", Online(), Pilot(), "index", "3").items():
        (tmp_path / file_name).write_text(text)
    config = parser.ConfigParser(str(tmp_path / "E_ETH.xml"))
    assert set(config.receive_variables["RKorr"]) == set("XYZABC")
    assert limits.parse_ethernet_timeout(str(tmp_path / "E.rsi.xml")) == 5

"""Tool libraries of CAM systems: what each format states, what a cell cannot describe, what is open."""

import json
import zipfile

import pytest

from gcode2krl.cell.tool_files import read_tools
from gcode2krl.errors import NotUnderstoodError
from tests.cli.test_batch import CELL, GOOD

INCH_MM = 25.4


def fusion_tool(number, type_name, unit="millimeters", holder=True, **geometry):
    tool = {"type": type_name, "unit": unit, "description": f"tool {number}", "geometry": geometry}
    tool["post-process"] = {"number": number}
    if holder:
        tool["holder"] = {"segments": [{"height": 20, "lower-diameter": 18, "upper-diameter": 25}]}
    return tool


LIBRARY = {
    "data": [
        fusion_tool(
            1, "flat end mill", DC=10, NOF=3, RE=0, LCF=22, SFDM=10, LB=40, TA=0, assemblyGaugeLength=95.5
        ),
        fusion_tool(2, "ball end mill", "inches", holder=False, DC=0.25, NOF=2, LCF=0.75, SFDM=0.25, LB=1.5),
        fusion_tool(4003, "bull nose end mill", DC=12, NOF=4, RE=1.5, LCF=26),
        fusion_tool(4, "drill", DC=8.5, NOF=2, SIG=140, LCF=60),
        fusion_tool(5, "chamfer mill", DC=10, NOF=2, TA=45, LCF=4, **{"tip-diameter": 1.0}),
        fusion_tool(6, "tapered mill", DC=6, NOF=2, TA=3, **{"tip-diameter": 0}),
        fusion_tool(7, "tap right hand", DC=6, NOF=3),
        {"type": "holder", "segments": []},
    ]
}


@pytest.fixture
def library(tmp_path):
    file = tmp_path / "library.json"
    file.write_text(json.dumps(LIBRARY), encoding="utf-8")
    return file


def keys(tools):
    return {tool.number: dict(tool.keys) for tool in tools if not tool.unread}


def test_a_library_of_fusion_states_shape_holder_and_length(library):
    tools = keys(read_tools(library))
    assert tools[1] == {
        "diameter_mm": 10.0,
        "teeth": 3,
        "flute_length_mm": 22.0,
        "shank_diameter_mm": 10.0,
        "stick_out_mm": 40.0,
        "length_mm": 95.5,
        "holder_diameter_mm": 18.0,
        "kind": "flat",
    }
    assert tools[2]["diameter_mm"] == pytest.approx(0.25 * INCH_MM)
    assert "stick_out_mm" not in tools[2]  # no holder: how far it sticks out is not known
    assert (tools[4003]["kind"], tools[4003]["corner_radius_mm"]) == ("bull-nose", 1.5)
    assert tools[4]["point_deg"] == 140.0
    assert (tools[5]["kind"], tools[5]["diameter_mm"], tools[5]["taper_deg"]) == ("tapered", 1.0, 45.0)


def test_what_a_cell_cannot_describe_is_told_with_its_reason(library):
    unread = {tool.number: tool.unread for tool in read_tools(library) if tool.unread}
    assert set(unread) == {6, 7}
    assert "flat tip" in unread[6]


def test_the_packed_library_is_the_same(library, tmp_path):
    packed = tmp_path / "library.tools"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(library, "tools.json")
    assert read_tools(packed) == read_tools(library)


@pytest.mark.parametrize("separator", [",", "\t", ";"])
def test_a_table_of_hsm_has_a_row_for_each_preset(tmp_path, separator):
    head = ["Tool Index (tool_index)", "Number (tool_number)", "Type (tool_type)", "Diameter (tool_diameter)"]
    head += ["Unit (tool_unit)", "Number of Flutes (tool_numberOfFlutes)", "Radius (tool_cornerRadius)"]
    rows = [["1", "4", "bull nose end mill", "0.5", "inches", "4", "0.03"]] * 2
    rows += [["2", "9", "flat end mill", "6", "millimeters", "3", "0"]]
    file = tmp_path / "t.csv"
    file.write_text("\n".join(separator.join(row) for row in (head, *rows)), encoding="utf-8")
    tools = read_tools(file)
    assert [tool.number for tool in tools] == [4, 9]
    assert tools[0].keys["corner_radius_mm"] == pytest.approx(0.03 * INCH_MM)
    assert dict(tools[1].keys) == {"diameter_mm": 6.0, "teeth": 3, "kind": "flat"}


def test_a_library_of_freecad_has_its_bits_in_a_folder_beside(tmp_path):
    (tmp_path / "Bit").mkdir()
    (tmp_path / "Library").mkdir()
    bit = {
        "name": "5mm",
        "shape": "endmill.fcstd",
        "parameter": {"Diameter": "5.0000 mm", "CuttingEdgeHeight": '1 "'},
    }
    (tmp_path / "Bit/five.fctb").write_text(
        json.dumps(bit | {"attribute": {"Flutes": "3"}}), encoding="utf-8"
    )
    drill = {
        "name": "3mm",
        "shape": "drill.fcstd",
        "parameter": {"Diameter": "3,0 mm", "TipAngle": "118.00 °"},
    }
    (tmp_path / "Bit/three.fctb").write_text(json.dumps(drill), encoding="utf-8")
    entries = [
        {"nr": n, "path": path} for n, path in ((1, "five.fctb"), (2, "sub/three.fctb"), (3, "gone.fctb"))
    ]
    file = tmp_path / "Library/Default.fctl"
    file.write_text(json.dumps({"tools": entries, "version": 1}), encoding="utf-8")
    one, two, three = read_tools(file)
    assert dict(one.keys) == {"diameter_mm": 5.0, "teeth": 3, "flute_length_mm": INCH_MM, "kind": "flat"}
    assert dict(two.keys) == {"diameter_mm": 3.0, "point_deg": 118.0, "kind": "drill"}  # teeth are left open
    assert "gone.fctb" in three.unread


def test_a_table_of_linuxcnc_leaves_its_unit_open(tmp_path):
    file = tmp_path / "tool.tbl"
    file.write_text(
        "T1 P1 D0.125 Z+0.511 ; 1/8 end mill 2 flute\nT2 P2 D6 ;ball\nT3 D3\n; T9 D3\n", encoding="utf-8"
    )
    with pytest.raises(NotUnderstoodError, match="unit"):
        read_tools(file)
    tools = keys(read_tools(file, "inch"))
    assert tools[1] == {"diameter_mm": pytest.approx(0.125 * INCH_MM), "teeth": 2, "kind": "flat"}
    assert tools[2]["kind"] == "ball"
    assert "kind" not in tools[3]  # nothing says what it is


def test_the_header_of_a_program_names_its_tools(tmp_path):
    file = tmp_path / "part.nc"
    text = "(T5 D=10. CR=0.5 - ZMIN=-2 - bullnose end mill)\n(T8 D=6. CR=0. TAPER=118deg - drill)\nG21\n"
    file.write_text(text, encoding="ascii")
    tools = keys(read_tools(file))
    assert tools[5] == {"diameter_mm": 10.0, "corner_radius_mm": 0.5, "kind": "bull-nose"}
    assert tools[8] == {"diameter_mm": 6.0, "point_deg": 118.0, "kind": "drill"}
    file.write_text(text.replace("G21", "G20"), encoding="ascii")
    assert keys(read_tools(file))[5]["diameter_mm"] == pytest.approx(254.0)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", "{"),
        ("a.json", "[]"),
        ("a.json", '{"data": [{"type": "flat end mill", "unit": "furlongs"}]}'),
        ("a.json", '{"data": 3}'),
        ("a.tools", "not packed"),
        ("a.fctl", '{"tools": [{}]}'),
        ("a.csv", "a,b\n1,2\n"),
        ("a.nc", "G0 X1\n"),
        ("a.json", "[" * 100_000),
    ],
)
def test_a_file_that_is_no_library_is_one_line(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError) as refused:
        read_tools(tmp_path / name)
    assert len(refused.value.issues) == 1


def test_tools_become_sections_of_a_cell_and_the_program_is_written(library, run, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    (tmp_path / "part.nc").write_text(
        GOOD.format(x=50).replace("T1", "T4001").replace("H1", "H4001"), encoding="ascii"
    )
    assert "gcode2krl tools import" in run("part.nc", "--cell", "cell.toml", "-o", "PART.src", code=1).err
    numbered = json.loads(library.read_text(encoding="utf-8"))
    numbered["data"][0]["post-process"]["number"] = 4001
    library.write_text(json.dumps(numbered), encoding="utf-8")
    assert run("tools", "import", library, "--cell", "cell.toml").code == 0
    assert run("part.nc", "--cell", "cell.toml", "-o", "PART.src").code == 0


def test_what_the_cell_has_stays_and_a_difference_is_told(library, run, tmp_path):
    mine = CELL + "\n[tool.1]\ndiameter_mm = 8\nteeth = 2\nlength_mm = 80\n"
    (tmp_path / "cell.toml").write_text(mine, encoding="utf-8")
    words = ("--cell", "cell.toml", "--only", "1,4003", "--set", "4003.length_mm=101.5")
    assert "tool-differs" in run("tools", "import", library, *words, code=0).err
    text = (tmp_path / "cell.toml").read_text(encoding="utf-8")
    assert text.startswith(mine)
    assert "length_mm = 101.5" in text
    assert "[tool.2]" not in text


def test_a_cell_that_would_be_wrong_is_left_as_it_is(library, run, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    words = ("--cell", "cell.toml", "--only", "4003", "--set", "4003.length_mm=5")
    assert "shorter than the flutes" in run("tools", "import", library, *words, code=2).err
    assert (tmp_path / "cell.toml").read_text(encoding="utf-8") == CELL


def test_what_a_file_leaves_open_is_asked_and_not_made_up(run, tmp_path):
    (tmp_path / "tool.tbl").write_text("T3 P3 D6\n", encoding="ascii")
    bull = {"data": [fusion_tool(5, "bull nose end mill", DC=10, NOF=2)]}
    (tmp_path / "library.json").write_text(json.dumps(bull), encoding="utf-8")
    asked = run("tools", "import", "tool.tbl", "--unit", "mm")
    assert "--set 3.kind=flat --set 3.teeth=2" in asked.err
    assert "[tool.3]" not in asked.out
    assert "--set 5.corner_radius_mm=0.5" in run("tools", "import", "library.json").err
    stated = run("tools", "import", "tool.tbl", "--unit", "mm", "--set", "3.kind=flat", "--set", "3.teeth=4")
    assert "teeth = 4" in stated.out

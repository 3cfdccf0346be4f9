"""``gcode2krl inspect``: what is told of a program before anything is translated."""

import json

import pytest

FANUC = (
    "%\nO0042\n(T3 D=8. - flat end mill)\nG21 G90 G17\nT3 M6\nS6000 M3\nG55\nG43 H3 G0 Z30.\nX-5. Y0.\nZ2.\n"
)
CUT = "G1 Z-1. F200.\nX40. F900.\nG0 Z30.\nM98 P9001\nM5\nM30\nO9001\nG0 X0.\nM99\n%\n"


def seen(run, tmp_path, text, *options):
    part = tmp_path / "part.nc"
    part.write_text(text)
    outcome = run("inspect", part, "--json", *options)
    record = json.loads(outcome.out)
    return outcome.code, record.get("overview", {}), record["issues"]


def test_it_tells_what_stands_in_the_program_and_what_the_cell_must_say(run, tmp_path):
    code, overview, _ = seen(run, tmp_path, FANUC + CUT)
    assert code == 0
    assert (overview["control"], overview["mark"]) == ("a Fanuc or Haas", "O0042 (line 2)")
    assert (overview["dialect"], overview["unit"], overview["tools"]) == ("fanuc", "mm", ["T3"])
    assert overview["extent_mm"] == [[-5.0, 40.0], [0.0, 0.0], [-1.0, 30.0]]
    assert overview["feeds_mm_min"] == pytest.approx([200.0, 900.0])
    assert overview["speeds_rpm"] == pytest.approx([6000.0, 6000.0])
    assert (overview["offsets"], overview["subprograms"]) == (["G55"], ["9001"])
    asked = " ".join(overview["asked_of_cell"])
    assert all(
        word in asked for word in ("[tool.3]", "a comment says 8", "tool_change", "G55", "[m_code] M3")
    )


def test_tools_that_only_comments_name_are_told(run, tmp_path):
    text = (
        "G21 G90\n( M6 T2 )\n(Compensated Tool Path. Diameter: 4.0)\nM3 S9000\nG0 X0 Y0 Z5\nG1 X5 F100\nM2\n"
    )
    _, overview, _ = seen(run, tmp_path, text)
    assert overview["tools"] == []
    assert any("T2" in line and "comment alone" in line for line in overview["comments"])
    assert any("mounted_tool" in line for line in overview["asked_of_cell"])


def test_a_program_that_is_refused_is_seen_all_the_same(run, tmp_path):
    code, overview, issues = seen(run, tmp_path, "G17 G90 G710\nT1 D1\nM6\nG0 X0 Y0 Z5\nCYCLE72(1)\nM30\n")
    assert (code, overview["moves"], overview["dialect"]) == (2, None, "sinumerik")
    assert [issue["line"] for issue in issues] == [5]


def test_what_is_no_program_gets_its_one_sentence(run, tmp_path):
    code, overview, issues = seen(run, tmp_path, "ISO-10303-21;\nHEADER;\n")
    assert (code, overview) == (2, {})
    assert [issue["code"] for issue in issues] == ["not-a-part"]


def test_for_a_person_it_is_lines_of_text(run, tmp_path):
    (tmp_path / "part.nc").write_text(FANUC + CUT)
    assert "X -5..40, Y 0..0, Z -1..30 mm" in run("inspect", tmp_path / "part.nc", code=0).out

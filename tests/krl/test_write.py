"""How programs are written: names, bytes, numbers, guard, and nothing half-written."""

import errno
import itertools
import os
import re
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl import set_targets, write_krl
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl.number_text import fixed, motion_lines
from tests.cells import OWN_CELL, over_demonstration, signed
from tests.krl.conftest import PART, read
from tests.krl.replay import components, frame

# --- names ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("part", "PART"),
        ("PART_12", "PART_12"),
        ("Test_Piece", "TEST_PIECE"),
        ("test-piece", "TEST_PIECE"),
        ("two words.v2", "TWO_WORDS_V2"),
        ("1234", "P_1234"),
        ("lin", "LIN_1"),
        ("größe", "GR_SSE"),
        ("---", "PART"),
        ("a_name_of_more_than_24_characters", "A_NAME_OF_MORE_THAN_24_C"),
    ],
)
def test_name_from_the_file(make, stem, name):
    made = make(stem=stem, into_folder=True)
    assert made.program.name == name
    assert made.src.stem.upper() == name
    assert re.findall(r"(?m)^DEF (\w+)\( \)", made.text) == [name]
    assert re.findall(r"(?m)^DEFDAT (\w+)", made.program.files[1].read_text("ascii")) == [name]
    codes = [issue.code for issue in made.program.issues if issue.code == "krl-name"]
    assert codes == ([] if name == stem.upper() else ["krl-name"])
    assert made.verified().ok


@pytest.mark.parametrize("name", ["job_7", "JOB_7", "A" * 24, "_X"])
def test_name_given(make, name):
    made = make(name=name, into_folder=True)
    assert made.program.name == name.upper()
    assert made.src.name == f"{name}.src"
    assert f"DEF {name.upper()}( )\r\n" in made.text
    assert "krl-name" not in [issue.code for issue in made.program.issues]


GROWS = pytest.param("ß" * 20, id="40 letters in upper case")


@pytest.mark.parametrize(
    "name", ["", "7job", "A" * 25, "test-piece", "two words", "LIN", "endif", "größe", GROWS, "A\n"]
)
def test_bad_name_given(make, tmp_path, name):
    with pytest.raises(NotUnderstoodError, match="krl-name"):
        make(name=name)
    assert list(tmp_path.glob("*.src")) == []


@pytest.mark.parametrize("name", ["PART_001", "ABCDEFGHIJKLMNOPQRST_001", "ABCDEFGHIJKLMNOPQRSTUVWX"])
@pytest.mark.parametrize("split", ["defs", "files"])
def test_parts_have_names_of_their_own(make, name, split):
    """Whatever the program's name, no part has it, and none is longer than 24 characters."""
    made = make(name=name, split=split, data={"program": {"max_lines": 100}}, text=long_part(250), stem=name)
    text = "".join(file.read_text("ascii") for file in made.program.files if file.suffix == ".src")
    names = re.findall(r"(?m)^DEF (\w+)", text)
    assert len(names) == len(set(names)) > 3
    assert max(map(len, names)) <= 24
    assert made.verified().ok


def test_parts_of_two_programs_in_one_folder_do_not_collide(make):
    """Two long names that differ only at their end."""
    data = {"program": {"max_lines": 100}}
    first = make(long_part(150), stem="HOUSING_LEFT_SIDE_OP10A", split="files", data=data)
    second = make(long_part(160), stem="HOUSING_LEFT_SIDE_OP10B", split="files", data=data)
    assert not set(first.program.files) & set(second.program.files)
    assert first.verified().ok


def long_part(moves: int) -> str:
    lines = "".join(f"G1 X{k % 2} Y{0.5 * k:.1f}\n" for k in range(moves))
    head = "G21 G90 G54 G64 P0.02\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F900\n"
    return f"{head}{lines}G0 Z20\nM30\n"


# --- bytes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options", [{}, {"guard": False}, {"split": "files"}, {"options": "Größe 5 µm\nEND"}]
)
def test_every_byte_is_fit_for_the_controller(make, options):
    text = PART.replace("M8\n", 'M8\n(MSG, Größe prüfen "A" {1})\n')
    made = make(text, **options)
    for file in made.program.files:
        data = file.read_bytes()
        assert data.isascii()
        assert data.endswith(b"\r\n")
        assert data.count(b"\r") == data.count(b"\n") == data.count(b"\r\n")
        assert not re.search(rb"[ \t]\r\n", data)
        assert b"\t" not in data
        assert max(map(len, data.splitlines())) < 472
    assert len(re.findall(rb"(?m)^END\r$", made.src.read_bytes())) == len(
        re.findall(rb"(?m)^DEF ", made.src.read_bytes())
    )
    assert made.verified().ok


def test_same_input_same_bytes(make):
    first = make()
    before = [file.read_bytes() for file in first.program.files]
    again = make()
    assert [file.read_bytes() for file in again.program.files] == before == list(first.program.texts.values())


def test_no_date_and_no_folder_in_the_text(make, tmp_path):
    text = make().text
    assert str(tmp_path) not in text
    assert not re.search(r"\d{4}-\d{2}-\d{2}|\d{2}:\d{2}", text)


def test_without_a_path_nothing_is_written(make, tmp_path):
    made = make()
    for file in made.program.files:
        file.unlink()
    written = write_krl(made.targets, None, made.cell, name="ALONE")
    assert written.files == ()
    assert set(written.texts) == {"ALONE.src"}
    assert b"EXT BAS (BAS_COMMAND :IN,REAL :IN )" in written.texts["ALONE.src"]
    assert list(tmp_path.glob("*.src")) == []


# --- nothing half-written -------------------------------------------------------------------------------


def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def nth(method, n):
    """Return a method that works n - 1 times and then finds the disk full."""
    calls = []

    def counted(*arguments, **options):
        calls.append(1)
        return full() if len(calls) >= n else method(*arguments, **options)

    return counted


@pytest.mark.parametrize(
    "victim", [(os, "fsync"), (Path, "replace"), (os, "fdopen"), (Path, "chmod")], ids=lambda v: v[1]
)
@pytest.mark.parametrize(("call", "split"), [(1, "defs"), (2, "files")])
def test_full_disk_leaves_the_old_files(make, tmp_path, monkeypatch, victim, call, split):
    """All old or all new, whichever write the disk refuses."""
    data = {"program": {"max_lines": 100}}
    old = make(long_part(150), split=split, data=data)
    before = {file.name: file.read_bytes() for file in old.program.files}
    monkeypatch.setattr(*victim, nth(getattr(*victim), call))
    with pytest.raises(NotUnderstoodError, match="output-unwritable") as refused:
        make(long_part(160), split=split, data=data)
    monkeypatch.undo()
    assert refused.value.exit_code == 2
    assert "No space left" in str(refused.value)
    assert {file.name for file in tmp_path.iterdir()} == {*before, "part.nc"}, "temporary files remain"
    assert {name: (tmp_path / name).read_bytes() for name in before} == before


def test_full_disk_leaves_nothing_new(make, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(NotUnderstoodError):
        make()
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]


def test_folder_that_does_not_exist(make, tmp_path):
    made = make()
    with pytest.raises(NotUnderstoodError, match="output-unwritable"):
        write_krl(made.targets, tmp_path / "nowhere" / "part.src", made.cell)


def test_refused_program_leaves_the_old_files(make):
    made = make()
    before = [file.read_bytes() for file in made.program.files]
    with pytest.raises(RefusedError, match="spindle-off"):
        make(PART.replace("S8000 M3\n", ""))
    assert [file.read_bytes() for file in made.program.files] == before


# --- cell and guard -------------------------------------------------------------------------------------


def test_cell_that_nobody_verified_halts_first(make):
    text = make().text
    assert "HAS NOT BEEN VERIFIED" in text
    assert re.search(r"(?m)^HALT\r$", text).start() < re.search(r"(?m)^(PTP|LIN|WHILE)", text).start()


def test_verified_cell_does_not_halt(make):
    made = make(
        PART.split("T2 M6")[0] + "M30\n",
        data=signed(OWN_CELL | {"tool_change": "; changed by hand"}),
    )
    text = made.text
    assert "cell verified by A. Person on 2026-01-31" in text
    assert "HAS NOT BEEN VERIFIED" not in text
    guarded = re.sub(r"(?ms)^WHILE.*?^ENDWHILE", "", text)
    assert "HALT" not in guarded
    assert "cell-not-verified" not in {issue.code for issue in made.program.issues}


def test_header_says_what_is_not_checked(make):
    head = make().text.split("PTP {")[0]
    assert "not a safety function" in head
    assert "NOT CHECKED" in head


def test_released_findings_stand_in_the_header(make):
    text = PART.replace("G1 X40 F1500", "G1 X40 F1500\nM77")
    with pytest.raises(RefusedError, match="m-code-unmapped"):
        make(text)
    made = make(text, allow=["m-code-unmapped:11"])
    assert "; findings released by hand: m-code-unmapped:11\r\n" in made.text
    assert made.verified().ok


def test_no_guard_is_recorded(make):
    guarded, bare = make().text, make(stem="bare", guard=False).text
    assert "--no-guard" not in guarded
    assert "LEFT OUT (--no-guard)" in bare
    assert "$TRAFONAME" in guarded
    assert "$TRAFONAME" not in bare
    assert "WHILE" not in bare


def test_program_without_guard_verifies_as_such(make):
    made = make(guard=False)
    assert made.verified().ok
    made.src.write_bytes(made.src.read_bytes().replace(b"(--no-guard)", b"(        )"))
    assert not made.verified().ok


def test_guard_stands_before_any_motion(make):
    data = {
        "guard_inputs": [
            {"number": 17, "value": False, "meaning": "door closed"},
            {"number": 9, "meaning": "air"},
        ]
    }
    text = make(data=data).text
    head = text[: re.search(r"(?m)^(PTP|LIN)", text).start()]
    assert re.findall(r"WHILE (\$IN\[\d+\]<>\w+)", head) == ["$IN[17]<>FALSE", "$IN[9]<>TRUE"]
    assert "Input 17: door closed" in head
    assert head.index("$TRAFONAME") < head.index("$IN[17]")
    assert head.count("WHILE") == head.count("ENDWHILE") * 2 == 6  # ENDWHILE contains WHILE


FRAME = {"x_mm": 240.5, "y_mm": -7.25, "z_mm": 251.125, "a_deg": 177.5, "b_deg": -1.5, "c_deg": -179.25}
BASE = {"x_mm": 1480.0, "y_mm": 25.0, "z_mm": 790.0, "a_deg": 2.0, "b_deg": 0.5, "c_deg": -0.25}


def kuka(values) -> dict[str, float]:
    return dict(zip("XYZABC", values.values(), strict=True))


def test_frames_by_number_are_compared(make):
    """GK_INV is the inverse of what the cell file says: no difference where the controller agrees."""
    tool = {"1": {"tool_data": 4, "axis": "+x", "frame": FRAME}}
    data = {"tool": tool, "frames": {"base": BASE, "base_data": 12}}
    made = make(PART.split("T2 M6")[0] + "M30\n", data=data)
    text = made.text
    assert "BAS (#TOOL,4 )" in text
    assert "BAS (#BASE,12 )" in text
    assert not re.search(r"(?m)^\$(BASE|TOOL|LOAD)=", text)
    checks = dict(re.findall(r"GK_INV=\{(.*?)\}\r\nGK_DIFF=GK_INV:(\w+\[\d+\])", text))
    found = {variable: frame(components(values)) for values, variable in checks.items()}
    assert set(found) == {"BASE_DATA[12]", "TOOL_DATA[4]"}
    for variable, expected in (("BASE_DATA[12]", BASE), ("TOOL_DATA[4]", FRAME)):
        difference = found[variable] * frame(kuka(expected))
        assert np.abs(difference.translation).max() < 0.01
        assert np.degrees(difference.rotation.magnitude()) < 0.001
    first = re.search(r"(?m)^(PTP|LIN|BAS \(#TOOL)", text).start()
    assert max(text.index(variable) for variable in found) < first
    for limit in re.findall(r"ABS\(GK_DIFF\.([XYZABC])\)>([0-9.]+)", text):
        assert float(limit[1]) == (0.1 if limit[0] in "XYZ" else 0.05)


def test_poses_are_turned_into_the_tools_own_axes(make):
    """With the tool along +x, x of the written pose points from tip to holder."""
    tool = {"1": {"tool_data": 4, "axis": "+x", "frame": FRAME}}
    made = make(PART.split("T2 M6")[0] + "M30\n", data={"tool": tool})
    poses = [components(values) for values in re.findall(r"(?m)^LIN \{(.*)\}", made.text)]
    assert poses
    for pose in poses:
        x_axis = Rotation.from_euler("ZYX", [pose[key] for key in "ABC"], degrees=True).as_matrix()[:, 0]
        assert x_axis == pytest.approx([0, 0, 1], abs=1e-5)
    assert [pose["X"] for pose in poses if pose["X"] == 40.0]


def test_tool_frame_follows_the_length(make):
    """A tool 30 mm longer has its tip 30 mm further along its axis."""
    made = make(data={"tool": {"2": {"length_mm": 130.0}}})
    frames = [frame(components(values)) for values in re.findall(r"(?m)^\$TOOL=\{(.*?)\}", made.text)]
    short, long = frames[0], frames[-1]
    difference = short.inv() * long
    assert difference.translation == pytest.approx([0, 0, -30.0])
    assert difference.rotation.magnitude() == pytest.approx(0, abs=1e-9)


def test_spindle_waits_for_its_input_where_there_is_one(make):
    with_input = make(data={"spindle": {"at_speed_input": 33}}).text
    assert re.search(r"\$OUT\[1\]=TRUE\r\nWAIT FOR \$IN\[33\]\r\n", with_input)
    assert re.search(r"\$OUT\[1\]=TRUE\r\nWAIT SEC 5.0\r\n", make(stem="timed").text)


def test_external_subprograms_are_declared(make):
    data = {
        "program": {"externals": ["SPINDLE_ON(INT :IN)", "SPINDLE_OFF( )"]},
        "m_code": {"M3": "SPINDLE_ON({{ rpm | round | int }})", "M5": "SPINDLE_OFF( )"},
    }
    made = make(data=data)
    text = made.text
    assert text.index("EXT SPINDLE_ON(INT :IN)") < text.index(";FOLD INI") < text.index("SPINDLE_ON(8000)")
    assert made.verified().ok


def test_call_without_declaration_is_refused(make):
    with pytest.raises(RefusedError, match=r"m_code\.M8 .* COOLANT, which program\.externals .*\[template\]"):
        make(data={"m_code": {"M8": "COOLANT(1)"}})


@pytest.mark.parametrize(
    "template",
    [
        "$OUT[{{ no_such_name }}]=TRUE",
        "$OUT[{{ spindle.no_such_name }}]=TRUE",
        "{% if %}",
        "{{ rpm / 0 }}",
        "{{ rpm + 'a' }}",
        "{{ rpm | no_such_filter }}",
        "{{ {}.popitem() }}",
    ],
)
def test_template_with_an_error_is_refused(make, tmp_path, template):
    with pytest.raises(RefusedError, match="template"):
        make(data={"m_code": {"M3": template}})
    assert list(tmp_path.glob("*.src")) == []


@pytest.mark.parametrize(
    "template",
    [
        "WAIT SEC 1.0\n$OUT[3]=TRUE",
        "$OUT[3]=TRUE\nWAIT SEC 1.0",
        "WAIT FOR $IN[5]",
        "",
        "; nothing",
        "PULSE ($OUT[3],TRUE,0.5)",
    ],
)
def test_template_of_any_form_verifies(make, template):
    """A template may begin with a wait: that is no dwell of the G-code."""
    made = make(PART.replace("G1 X40 F1500", "G1 X40 F1500\nM10"), data={"m_code": {"M10": template}})
    assert made.verified().ok


@pytest.mark.parametrize("where", ["prologue", "epilogue"])
@pytest.mark.parametrize("template", ["$OUT[50]=TRUE", "WAIT SEC 2.0", "$OUT[50]=TRUE\nWAIT FOR $IN[50]"])
def test_prologue_and_epilogue(make, where, template):
    made = make(data={"program": {where: template}})
    text = made.text
    motions = [found.start() for found in re.finditer(r"(?m)^(PTP|LIN)", text)]
    at = text.rindex(template.split("\n")[0])
    assert at < motions[0] if where == "prologue" else at > motions[-1]
    assert made.verified().ok


def test_long_program_warns_with_the_split(make):
    made = make(long_part(150), data={"program": {"memory_moves": 100}})
    issue = next(issue for issue in made.program.issues if issue.code == "program-large")
    assert "--split files" in issue.remedy


def test_comments_lead_back_to_the_gcode(make):
    made = make(data={"program": {"comment_every": 1}})
    lines = made.text.splitlines()
    pairs = [(int(k[7:]), m) for k, m in itertools.pairwise(lines) if re.fullmatch(r"; line \d+", k)]
    assert len(pairs) > 10
    for number, motion in pairs:
        word = re.search(r"X(-?[0-9.]+)", PART.splitlines()[number - 1])
        found = re.match(r"LIN \{X (-?[0-9.]+)", motion)
        if word and found:
            assert float(found[1]) == float(word[1])


@pytest.mark.parametrize(
    ("order", "wanted"),
    [
        ("S9000 M3\nG4 P3\n", ["$OUT[1]=TRUE", "WAIT SEC 3.000 ; dwell"]),
        ("G4 P3\nS9000 M3\n", ["WAIT SEC 3.000 ; dwell", "$OUT[1]=TRUE"]),
        ("G4 P3\nM9\n", ["WAIT SEC 3.000 ; dwell", "$OUT[3]=FALSE"]),
        ("M9\nG4 P3\n", ["$OUT[3]=FALSE", "WAIT SEC 3.000 ; dwell"]),
    ],
)
def test_dwell_and_events_keep_their_order(make, order, wanted):
    """``M3``, ``G4 P3``: the spindle starts first and is then given its time."""
    text = "G21 G90 G54\nT1 M6\nG43 H1\nS9000 M4\nG0 X0 Y0\nG0 Z9\n" + order + "S9000 M3\nG1 Z-1 F600\nM30\n"
    lines = make(text).text.split("Z 9.000")[1].split("LIN")[0].splitlines()
    places = [lines.index(line) for line in wanted]
    assert places == sorted(places)


# --- numbers --------------------------------------------------------------------------------------------

nanos = st.integers(-(10**13), 10**13)
decimals = st.sampled_from([0, 3, 4, 7])


def rounded(nano: int, places: int) -> str:
    """Return nano / 1e9 with fixed decimals by the decimal module, half away from zero, never -0."""
    value = (Decimal(nano) / 10**9).quantize(Decimal(1).scaleb(-places), ROUND_HALF_UP)
    return f"{value if value else abs(value):f}"


@settings(deadline=None)
@given(nanos, decimals)
def test_number_as_in_the_decimal_module(nano, places):
    assert fixed(nano / 1e9, places) == rounded(nano, places)


@settings(deadline=None)
@given(st.integers(-(10**7), 10**7), decimals.filter(bool))
def test_halves_go_away_from_zero(count, places):
    """Halves, and values a hair beside them that the quantisation at 1e-9 takes for halves."""
    nano = (2 * count + 1) * 10 ** (9 - places) // 2
    for hair in (0.0, 3e-10, -3e-10):
        if abs(nano) < 10**13:
            assert fixed(nano / 1e9 + hair, places) == rounded(nano, places)


@settings(deadline=None)
@given(st.floats(-1e4, 1e4), decimals)
def test_number_is_near(value, places):
    text = fixed(value, places)
    tail = rf"\.\d{{{places}}}" if places else ""
    assert re.fullmatch(r"-?\d+" + tail, text)
    assert abs(Decimal(text) - Decimal(value)) <= Decimal(1).scaleb(-places) / 2 + Decimal("1.1e-9")
    assert not re.fullmatch(r"-0(\.0*)?", text)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.000"),
        (-0.0, "0.000"),
        (-4e-4, "0.000"),
        (-5e-4, "-0.001"),
        (1.0005, "1.001"),
        (1e-12, "0.000"),
    ],
)
def test_signs_of_zero(value, text):
    assert fixed(value, 3) == text


poses = st.lists(st.lists(nanos, min_size=6, max_size=6), min_size=1, max_size=5)


@settings(deadline=None)
@given(poses, st.integers(1, 2 * 10**9), st.sampled_from([0.0, 0.05]))
def test_motion_lines_use_the_same_rule(rows, speed, cdis):
    values = np.array(rows) / 1e9
    pieces = motion_lines(
        values[:, :3],
        values[:, 3:],
        np.full(len(rows), speed / 1e9),
        np.full(len(rows), cdis),
        np.zeros(len(rows), dtype=np.int32),
        np.array([-1.0, -1.0, 0.0]),
        0,
    )
    text = b"".join(pieces).decode("ascii")
    expected = [f"$VEL.CP={rounded(speed, 7)}", *(["$APO.CDIS=0.050"] if cdis else [])]
    for row in rows:
        parts = zip("XYZABC", row, (3, 3, 3, 4, 4, 4), strict=True)
        pose = ",".join(f"{key} {rounded(nano, places)}" for key, nano, places in parts)
        expected.append(f"LIN {{{pose}}}{' C_DIS' if cdis else ''}")
    assert text == "\r\n".join(expected) + "\r\n"


def test_feed_is_exact_to_a_tenth_of_a_millimetre_a_minute(tmp_path):
    cell = over_demonstration()
    for feed in (0.1, 7.3, 1234.5, 5999.9):
        toolpath = read(PART.replace("F1500", f"F{feed}"), cell)
        written = write_krl(set_targets(toolpath, cell), None, cell)
        speeds = [float(v) * 60000 for v in re.findall(rb"\$VEL\.CP=([0-9.]+)", written.texts["PART.src"])]
        assert min(abs(speed - feed) for speed in speeds) < 0.1 / 2

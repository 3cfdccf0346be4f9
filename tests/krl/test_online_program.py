"""Programs that are corrected online: where RSI is switched, what is refused, and what verify notices."""

import re
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl import write_krl
from gcode2krl.cell import controller_axes
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.frames import abc_from_rotation
from gcode2krl.krl.rsi_rules import rsi_issues
from tests.krl.conftest import verified
from tests.krl.forces import cutting_below, with_forces
from tests.krl.test_pilot_program import predicted
from tests.krl.test_verify import change, delete, errors, insert, motions_of, tampered
from tests.krl.test_write import long_part

pytestmark = pytest.mark.slow

ADDRESS = {"online": {"link": {"address": "192.168.7.3"}}}
HEAD = "G21 G90 G17 G40 G49 G80 G94\nG54 G64 P0.02\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\n"
CUT = "G0 Z2\nG1 Z-2 F600\nG1 X40 F1500\nG1 Y30.5\nG1 X0 Y20\nG0 Z20\n"
FOOT = "M5\nM30\n"
PART = HEAD + CUT + FOOT

ON = """\
;FOLD RSI on: gcode2krl online serve must listen before
WAIT SEC 0.0
$OUT[1020]=FALSE
GK_RSI_RET=RSI_CREATE("ImFree.rsi",GK_RSI_ID,TRUE)
WHILE GK_RSI_RET<>RSIOK
HALT ; RSI_CREATE failed: cancel the program
ENDWHILE
GK_RSI_RET=RSI_ON(#ABSOLUTE,#IPO_FAST)
WHILE GK_RSI_RET<>RSIOK
HALT ; RSI_ON failed: cancel the program
ENDWHILE
WAIT FOR $OUT[1020] ; the absolute mode is proven
INTERRUPT DECL 21 WHEN $OUT[1020]==FALSE DO GK_RSI_LOST( )
INTERRUPT ON 21
WAIT FOR $OUT[1020]
;ENDFOLD (RSI on)
"""
OFF = """\
;FOLD RSI off
WAIT SEC 0.0
INTERRUPT OFF 21
GK_RSI_RET=RSI_OFF()
WHILE GK_RSI_RET<>RSIOK
HALT ; RSI_OFF failed: cancel the program
ENDWHILE
GK_RSI_RET=RSI_DELETE(GK_RSI_ID)
$OUT[1020]=FALSE
;ENDFOLD (RSI off)
"""
LOST = """\
DEF GK_RSI_LOST( )
INTERRUPT OFF 21
BRAKE
LIN_REL {Z 50.000} #TOOL
LOOP
HALT ; the RSI link is lost: switch the spindle off, cancel the program
ENDLOOP
END
"""


@pytest.fixture
def online(make):
    """Translate a part with ``--online``; the address is not that of the controller itself."""
    return lambda text=PART, data=None, **options: make(
        text, data={**ADDRESS, **(data or {})}, **{"online": "ImFree", **options}
    )


def piloted():
    """Return a prediction with forces."""
    prediction = predicted("G1 Z-2 F600\nG1 X40 F1500\nG1 Y30\n")
    return with_forces(prediction, cutting_below(prediction))


def text_of(made):
    return made.src.read_bytes().decode("ascii").replace("\r\n", "\n")


def motions_around(text, block):
    """Return the motions before and after a block of statements, each to its line."""
    before, after = text.split(block)
    motion = re.compile(r"^(?:PTP|LIN) .*$", re.M)
    return motion.findall(before), motion.findall(after)


# --- what is written ------------------------------------------------------------------------------------


def test_rsi_is_on_above_the_first_cut_and_off_above_the_last(online):
    made = online()
    text = text_of(made)
    before, after = motions_around(text, ON)
    assert [line[:7] for line in before] == ["PTP {A1", "PTP {X "]
    assert "Z 100.000" in before[-1]
    assert all(line.startswith("LIN") for line in after[:-1])
    before, after = motions_around(text, OFF)
    assert "Z 100.000" in before[-1]
    assert before[-1].startswith("LIN")
    assert not before[-1].endswith("C_DIS")
    assert len(after) == 1
    assert after[0].startswith("PTP {A1")
    assert text.endswith(f"\nEND\n\n{LOST}")
    assert text.index(";ENDFOLD (guard)") < text.index("RSI_CREATE")
    assert "DECL INT GK_RSI_RET,GK_RSI_ID\n" in text[: text.index(";FOLD INI")]
    assert "; corrected online by RSI: ImFree_ETH.xml and ImFree.rsi.xml\n" in text
    assert text.count("RSI_ON(") == text.count("RSI_OFF(") == 1


def test_the_motions_are_those_without_it(online, make):
    """By a reader that knows nothing of RSI; the subprogram of the interrupt is none of the program's."""
    with_rsi, without = online(), make(PART, stem="plain")
    text = text_of(with_rsi)
    with_rsi.src.write_bytes(text[: text.index("DEF GK_RSI_LOST")].encode("ascii"))
    assert motions_of(with_rsi.src) == motions_of(without.src)


def test_without_it_no_word_of_rsi(make):
    made = make()
    assert "RSI" not in text_of(made)
    assert [file.suffix for file in made.program.files] == [".src", ".dat"]


def test_all_files_are_written_together(online, tmp_path):
    made = online()
    names = ["part.src", "part.dat", "ImFree_ETH.xml", "ImFree.rsi.xml"]
    assert [file.name for file in made.program.files] == names
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([*names, "part.nc"])
    for file in made.program.files:
        data = file.read_bytes()
        assert data.isascii()
        assert data.count(b"\n") == data.count(b"\r\n") > 3
    assert made.verified().ok
    assert [i.code for i in made.program.issues if i.severity == "warning"] == []


def test_nothing_is_written_where_one_file_cannot_be(online, tmp_path):
    (tmp_path / "ImFree.rsi.xml").mkdir()
    with pytest.raises(NotUnderstoodError, match="cannot write"):
        online()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["ImFree.rsi.xml", "part.nc"]


@pytest.mark.parametrize("form", ["index", "values", "none"])
def test_the_pilot_is_set_before_rsi_is_on(tmp_path, form):
    prediction = piloted()
    program = write_krl(prediction, tmp_path / "part.src", pilot=form, online="A")
    text = (tmp_path / "part.src").read_text("ascii")
    flow = (tmp_path / "A.rsi.xml").read_text("ascii")
    variable = {"index": "SEN_PINT1", "values": "SEN_PREA4"}.get(form)
    assert ("SEN_PINT2" in flow) == (form != "none")
    if variable:
        assert variable in flow
        started = {"index": "$SEN_PINT[1]=-1", "values": "$SEN_PREA[4]=0.0"}[form]
        assert text.index(started) < text.index("$SEN_PINT[2]=") < text.index("RSI_CREATE")
        assert text.index("RSI_ON(") < text.index("TRIGGER")
    report = verified(program.files[0], prediction.toolpath, prediction.cell, prediction=prediction)
    assert report.ok, [issue.text() for issue in report.issues]


@pytest.mark.parametrize("cycle_s", [0.004, 0.012])
def test_settings_of_the_cell_reach_program_and_files(make, cycle_s):
    link = {"address": "10.0.0.9", "ready_output": 77, "t1_output": 78, "retract_mm": 12.5}
    made = make(PART, data={"online": {"cycle_s": cycle_s, "most_mm": 1.0, "link": link}}, online="B")
    text = text_of(made)
    assert f"RSI_ON(#ABSOLUTE,{'#IPO_FAST' if cycle_s == 0.004 else '#IPO'})\n" in text
    assert "WAIT FOR $OUT[77]" in text
    assert "LIN_REL {Z 12.500} #TOOL" in text
    assert "$OUT[78] (on in T1)" in text
    assert "<IP_NUMBER>10.0.0.9<" in (made.src.parent / "B_ETH.xml").read_text("ascii")
    assert made.verified().ok


@pytest.mark.parametrize("axis", ["+x", "-x", "-y", "-z"])
def test_the_retract_is_along_the_tool_axis_of_the_controller(online, cell, axis):
    turned = cell.tool_matrix(1) @ np.linalg.inv(controller_axes(axis))
    a, b, c = np.degrees(abc_from_rotation(turned[:3, :3])).tolist()
    frame = {
        **dict(zip(("x_mm", "y_mm", "z_mm"), turned[:3, 3].tolist(), strict=True)),
        "a_deg": a,
        "b_deg": b,
        "c_deg": c,
    }
    text = text_of(online(data={"tool": {"1": {"tool_data": 5, "axis": axis, "frame": frame}}}))
    size = {"+": "50.000", "-": "-50.000"}[axis[0]]
    assert f"LIN_REL {{{axis[1].upper()} {size}}} #TOOL" in text


@pytest.mark.parametrize("split", ["defs", "files"])
def test_long_programs_switch_rsi_in_the_main_program(online, split):
    made = online(long_part(250), data={"program": {"max_lines": 100}}, split=split)
    text = text_of(made)
    main = text[: text.index("\nEND\n")]
    assert ON in main
    assert OFF in main
    parts = [file.read_text("ascii") for file in made.program.files if re.search(r"_\d{3}\.src$", file.name)]
    assert all("RSI" not in part for part in parts)
    assert len(parts) == (0 if split == "defs" else 3)
    report = made.verified()
    assert report.ok, [issue.text() for issue in report.issues]


def test_what_follows_the_last_retract_comes_after_rsi(online):
    """A tool that is put away at the end is not touched while corrections are on."""
    text = text_of(online(HEAD + CUT + "M5\nT2 M6\nM30\n"))
    assert text.index("RSI_OFF()") < text.index("; line 14: M6 T2")
    assert text.index("HALT ; change to tool 1") < text.index("RSI_CREATE")


# --- what is refused ------------------------------------------------------------------------------------

REFUSED = {
    "two tools": (HEAD + CUT + "T2 M6\nS8000 M3\nG0 G43 H2 Z20\nG0 X0 Y0\n" + CUT + FOOT, "online-tool", 13),
    "the same tool again": (HEAD + CUT + "T1 M6\nS8000 M3\nG0 Z20\n" + CUT + FOOT, "online-tool", 13),
    "over HOME": (HEAD + CUT + "G28 X0 Y0\nG0 X0 Y0 Z20\n" + CUT + FOOT, "online-home", 13),
    "a halt": (HEAD + CUT + "M0\n" + CUT + FOOT, "online-halt", 13),
    "one position": (HEAD.replace("Z20", "Z100") + FOOT, "online-nothing", 0),
}


@pytest.mark.parametrize("case", REFUSED)
def test_programs_that_must_not_be_corrected_in_one_go(online, make, tmp_path, case):
    text, code, line = REFUSED[case]
    with pytest.raises(RefusedError) as caught:
        online(text)
    assert [(issue.code, issue.line) for issue in caught.value.issues if issue.severity == "error"] == [
        (code, line)
    ]
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]
    assert make(text).program.report.ok


def test_a_halt_may_be_released_and_a_tool_change_may_not(online):
    made = online(REFUSED["a halt"][0], allow=["online-halt:13"])
    assert made.verified().ok
    with pytest.raises(NotUnderstoodError, match="cannot be released"):
        online(REFUSED["two tools"][0], allow=["online-tool:13"])


def test_a_retract_in_z_over_g28_is_none_over_home(online):
    assert online(HEAD + CUT + "G28 Z0\nG0 X0 Y0 Z20\n" + CUT + FOOT).program.report.ok


def test_the_controllers_own_address_is_said(make):
    made = make(PART, online="A")
    assert [i.code for i in made.program.issues if i.severity == "warning"] == ["online-address"]


def test_an_output_that_the_cell_uses_otherwise_is_refused(online):
    with pytest.raises(NotUnderstoodError, match=r"1020\] has two meanings.*signal-twice"):
        online(data={"spindle": {"run_cw_output": 1020}})


def test_rsi_of_a_template_beside_ours_is_refused(online, make):
    data = {"program": {"epilogue": "GK_RET=RSI_OFF()"}}
    for program in (online, make):
        with pytest.raises(RefusedError, match=r"program\.epilogue .*RSI_OFF.*template"):
            program(data=data)


@pytest.mark.parametrize("name", ["", "../x", "a b", "x" * 17, "nul"])
def test_bad_names_are_refused_before_anything_is_written(online, tmp_path, name):
    with pytest.raises(NotUnderstoodError, match="name of the RSI files"):
        online(online=name)
    assert [file.name for file in tmp_path.iterdir()] == ["part.nc"]


def test_without_a_path_there_is_no_place_for_the_files(make):
    made = make(PART)
    with pytest.raises(NotUnderstoodError, match="standard output"):
        write_krl(made.targets, None, made.cell, online="A")


# --- what verify notices --------------------------------------------------------------------------------


def move(pattern, before, occurrence=0, lines_of_it=1):
    """Return an edit that moves lines to before another."""

    def edit(lines):
        at = next(k for k, line in enumerate(lines) if re.search(pattern, line))
        block = lines[at : at + lines_of_it]
        del lines[at : at + lines_of_it]
        to = [k for k, line in enumerate(lines) if re.search(before, line)][occurrence]
        lines[to:to] = block
        return to

    return edit


CREATE, SWITCH_ON, SWITCH_OFF = r"=RSI_CREATE\(", r"=RSI_ON\(", r"=RSI_OFF\("
READY = r"\$OUT\[1020\]"
TAMPERINGS = {
    "OFF missing": (delete(SWITCH_OFF), "rsi-order"),
    "ON missing": (delete(SWITCH_ON), "rsi-order"),
    "CREATE missing": (delete(CREATE), "rsi-order"),
    "DELETE missing": (delete(r"=RSI_DELETE\("), "rsi-order"),
    "ON twice": (insert("GK_RSI_RET=RSI_ON(#ABSOLUTE,#IPO_FAST)", r"^INTERRUPT OFF 21"), "rsi-order"),
    "OFF twice": (insert("GK_RSI_RET=RSI_OFF()", r"^WAIT FOR"), "rsi-order"),
    "ON after the first cut": (move(SWITCH_ON, r"^LIN", 2), "rsi-place"),
    "CREATE after the first LIN": (move(CREATE, r"^LIN", 1), "rsi-order"),
    "both after the first cut": (move(CREATE, r"^LIN", 2, 8), "rsi-place"),
    "ON before the approach": (move(CREATE, r"^PTP \{X", 0, 8), "rsi-place"),
    "OFF before the last retract": (move(r"^INTERRUPT OFF", r"^LIN \{", -1, 6), "rsi-place"),
    "OFF after HOME": (move(r"^INTERRUPT OFF", r"^END\s*$", 0, 6), "rsi-place"),
    "OFF behind a blended corner": (
        change(r"^(LIN \{.*Z 100.000.*\})", lambda text: text + " C_DIS", -1),
        "rsi-place",
    ),
    "relative": (change(r"RSI_ON\((#ABSOLUTE)", lambda _: "#RELATIVE"), "rsi-mode"),
    "default mode": (change(r"RSI_ON\((.*)\)", lambda _: ""), "rsi-mode"),
    "other cycle": (change(r"RSI_ON\(#ABSOLUTE,(#IPO_FAST)", lambda _: "#IPO"), "rsi-mode"),
    "other file": (change(r'RSI_CREATE\("(ImFree)', lambda _: "Other"), "rsi-file"),
    "file elsewhere": (change(r'RSI_CREATE\("(ImFree)', lambda _: "../ImFree"), "verify-statement"),
    "return not looked at": (change(r"^WHILE (GK_RSI_RET<>RSIOK)", lambda _: "1>2", 1), "verify-statement"),
    "not waited for": (delete(r"^WAIT FOR " + READY), "rsi-ready"),
    "not waited for again": (delete(r"^WAIT FOR " + READY, 1), "rsi-ready"),
    "waited for too late": (move(r"^WAIT FOR " + READY, r"^LIN", 1), "rsi-ready"),
    "not put out": (delete(f"^{READY}=FALSE"), "rsi-ready"),
    "put on": (change(f"^{READY}=(FALSE)", lambda _: "TRUE"), "rsi-ready"),
    "not watched": (delete(r"^INTERRUPT ON 21"), "rsi-ready"),
    "watched too late": (move(r"^INTERRUPT ON 21", r"^LIN", 3), "rsi-ready"),
    "no longer watched": (move(r"^INTERRUPT OFF 21", r"^LIN", 3), "rsi-ready"),
    "another output": (change("WHEN (.OUT.1020.)==FALSE", lambda _: "$OUT[102]"), "rsi-ready"),
    "no stop": (delete(r"^BRAKE"), "rsi-ready"),
    "no retract": (delete(r"^LIN_REL"), "verify-statement"),
    "into the part": (change(r"^LIN_REL \{Z (50.000)", lambda _: "-50.000"), "verify-statement"),
    "goes on": (delete(r"^HALT ; the RSI link"), "verify-statement"),
    "another RSI call": (insert("GK_RSI_RET=RSI_MOVECORR()", r"^INTERRUPT OFF 21"), "rsi-order"),
    "RSI off in the interrupt": (insert("GK_RSI_RET=RSI_OFF()", r"^BRAKE"), "rsi-ready"),
    "declaration": (delete(r"^DECL INT GK_RSI_RET"), "verify-statement"),
    "subprogram": (change(r"^DEF (GK_RSI_LOST)", lambda _: "GK_RSI_GONE"), "rsi-ready"),
}


@pytest.mark.parametrize("case", TAMPERINGS)
def test_tampering_is_noticed(online, case):
    edit, code = TAMPERINGS[case]
    made = online()
    tampered(made, edit)
    report = made.verified()
    assert not report.ok
    assert code in {issue.code for issue in errors(report)}, [issue.text() for issue in errors(report)]


@pytest.mark.parametrize("file_name", ["ImFree_ETH.xml", "ImFree.rsi.xml"])
@pytest.mark.parametrize("deed", ["missing", "changed"])
def test_the_files_beside_the_program_are_looked_at(online, file_name, deed):
    made = online()
    file = made.src.with_name(file_name)
    if deed == "missing":
        file.unlink()
    else:
        file.write_text(file.read_text("ascii").replace('"2.5"', '"25"').replace("49152", "49153"), "ascii")
    report = made.verified()
    assert [issue.code for issue in errors(report)] == ["rsi-file"]
    assert file_name in errors(report)[0].message


def test_files_of_another_cell_are_noticed(online, make):
    made = online()
    other = make(PART, stem="other", data={"online": {"most_mm": 1.0}})
    codes = [i.code for i in errors(verified(made.src, made.toolpath, other.cell))]
    assert codes == ["verify-cell-changed", "rsi-file", "rsi-file"]


def test_laid_out_anew_it_still_verifies(online):
    made = online()
    text = made.src.read_bytes().decode("ascii")
    for rewritten in (text.lower(), text.replace("\r", ""), re.sub(r"(?m)^;.*\r?\n", "", text)):
        made.src.write_bytes(rewritten.encode("ascii"))
        report = made.verified()
        assert report.ok, [issue.text() for issue in report.issues]


def test_the_rules_hold_without_the_intended_program(online):
    """What is read back before writing is not compared with a second composition: the rules must see it."""
    from gcode2krl.krl import read_krl

    made = online()
    assert list(rsi_issues(read_krl(made.src), made.cell)) == []
    lines = made.lines
    calls = [k for k, line in enumerate(lines) if re.search(r"RSI_(CREATE|ON|OFF)\(", line)]
    for first, second in pairwise(calls):
        swapped = [*lines]
        swapped[first], swapped[second] = swapped[second], swapped[first]
        made.src.write_bytes(("\n".join(swapped) + "\n").encode("ascii"))
        assert [i.code for i in rsi_issues(read_krl(made.src), made.cell)] == ["rsi-order"]

"""What was changed in a written program is noticed, with its line; what is merely laid out anew is not."""

import re
from itertools import pairwise

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from tests.cells import OWN_CELL
from tests.krl.conftest import Made, verified
from tests.krl.replay import read_program


def line_of(lines, pattern, occurrence=0):
    """Return the index of the line that matches a pattern."""
    return [k for k, line in enumerate(lines) if re.search(pattern, line)][occurrence]


def put(of, pattern, occurrence=0, count=1):
    """Return an edit: so many lines from the one that matches become ``of(lines)``; it returns the place."""

    def edit(lines):
        at = line_of(lines, pattern, occurrence)
        lines[at : at + count] = of(lines[at : at + count])
        return at

    return edit


def change(pattern, replace, occurrence=0):
    """Replace the first group of the pattern by ``replace(group)``."""

    def changed(lines):
        a, b = re.search(pattern, lines[0]).span(1)
        return [lines[0][:a] + replace(lines[0][a:b]) + lines[0][b:]]

    return put(changed, pattern, occurrence)


def delete(pattern, occurrence=0):
    """Noticed in the line that now stands there."""
    return put(lambda _: [], pattern, occurrence)


def insert(text, before, occurrence=0):
    return put(lambda _: [text + "\r"], before, occurrence, count=0)


def swap(pattern, occurrence=0):
    """Swap a line with the next."""
    return put(lambda lines: lines[::-1], pattern, occurrence, count=2)


def swap_lin(lines):
    """Swap two LIN that follow each other directly."""
    at = next(k for k, pair in enumerate(pairwise(lines)) if all(text.startswith("LIN") for text in pair))
    lines[at : at + 2] = lines[at + 1], lines[at]
    return at


def plus(amount, decimals):
    return lambda text: f"{float(text) + amount:.{decimals}f}"


def times(factor, decimals):
    return lambda text: f"{float(text) * factor:.{decimals}f}"


LIN = r"^LIN \{X 40.000"
TAMPERINGS = {
    "X by 0.01 mm": (change(r"^LIN \{X (40.000)", plus(0.01, 3)), "verify-position"),
    "Z by -0.01 mm": (change(LIN + r".*,Z (-?[0-9.]+)", plus(-0.01, 3)), "verify-position"),
    "Y of the approach": (change(r"^PTP \{X.*,Y (0.000)", plus(0.01, 3)), "verify-position"),
    "A by 0.01 deg": (change(LIN + r".*,A ([0-9.]+)", plus(0.01, 4)), "verify-rotation"),
    "B by -0.01 deg": (change(LIN + r".*,B ([0-9.]+)", plus(-0.01, 4)), "verify-rotation"),
    "C of the approach": (change(r"^PTP \{X.*,C ([0-9.]+)", plus(0.01, 4)), "verify-rotation"),
    "HOME": (change(r"^PTP \{A1 0.0000,A2 (-90.0000)", plus(0.01, 4)), "verify-position"),
    "HOME at the end": (change(r"^PTP \{A1 0.0000,A2 (-90.0000)", plus(0.01, 4), -1), "verify-position"),
    "LIN deleted": (delete(LIN, 1), "verify-count"),
    "LIN doubled": (insert("LIN {X 40.000,Y 0.000,Z 9.000,A 0,B 0,C 0}", LIN), "verify-count"),
    "LIN swapped": (swap_lin, "verify-position"),
    "C_DIS removed": (change(LIN + r".*\}( C_DIS)", lambda _: ""), "verify-cdis"),
    "C_DIS added": (change(r"^LIN \{X 40.000,Y 30.500.*\}()", lambda _: " C_DIS"), "verify-cdis"),
    "VEL.CP by 1 %": (change(r"^\$VEL.CP=(0.0250000)", times(1.01, 7)), "verify-speed"),
    "VEL.CP deleted": (delete(r"^\$VEL.CP=0.0250000"), "verify-speed"),
    "APO.CDIS": (change(r"^\$APO.CDIS=([0-9.]+)", times(2, 3)), "verify-cdis"),
    "BASE": (change(r"^\$BASE=\{X ([0-9.]+)", plus(0.01, 3)), "verify-statement"),
    "TOOL": (change(r"^\$TOOL=.*,B (-?[0-9.]+)", plus(0.01, 4)), "verify-statement"),
    "TOOL at the change": (change(r"^\$TOOL=.*,Z (-?[0-9.]+)", plus(30, 3), -1), "verify-statement"),
    "LOAD": (change(r"^\$LOAD=\{M ([0-9.]+)", plus(-20, 3)), "verify-statement"),
    "OUT deleted": (delete(r"^\$OUT\[1\]=TRUE"), "verify-statement"),
    "OUT inverted": (change(r"^\$OUT\[1\]=(TRUE)", lambda _: "FALSE"), "verify-statement"),
    "OUT moved": (swap(r"^\$OUT\[3\]=FALSE", -1), "verify-statement"),
    "dwell": (change(r"^WAIT SEC (0.750)", lambda _: "0.700"), "verify-wait"),
    "dwell deleted": (delete(r"^WAIT SEC 0.750"), "verify-wait"),
    "spindle wait": (change(r"^WAIT SEC (5.0)", lambda _: "0.0"), "verify-statement"),
    "HALT deleted": (delete(r"^HALT"), "verify-statement"),
    "guard loop emptied": (change(r"^WHILE \((.*)\)", lambda _: "1>2"), "verify-statement"),
    "ADVANCE": (change(r"^\$ADVANCE=(3)", lambda _: "0"), "verify-statement"),
    "ACC.CP": (change(r"^\$ACC.CP=(2.000)", lambda _: "9.000"), "verify-statement"),
    "S": (change(r"^PTP \{X.*,S (\d)", lambda text: str(int(text) ^ 4)), "verify-status"),
    "T": (change(r"^PTP \{X.*,T (\d+)", lambda text: str(int(text) ^ 32)), "verify-status"),
    "S missing": (change(r"^PTP \{X.*(,S \d)", lambda _: ""), "krl-incomplete"),
    "component missing": (change(LIN + r".*(,Z -?[0-9.]+)", lambda _: ""), "krl-incomplete"),
    "LIN to PTP": (change(r"^(LIN) \{X 40.000", lambda _: "PTP"), "verify-motion"),
    "CIRC": (insert("CIRC {X 1.0,Y 1.0,Z 1.0},{X 2.0,Y 2.0,Z 1.0} C_DIS", LIN), "krl-motion-unknown"),
    "SLIN": (change(r"^(LIN) \{X 40.000", lambda _: "SLIN"), "krl-motion-unknown"),
    "SPTP": (insert("SPTP {A1 0.0}", LIN), "krl-motion-unknown"),
    "PTP_REL": (insert("PTP_REL {A1 5.0}", LIN), None),
    "LIN_REL": (insert("LIN_REL {Z -5.0}", LIN), None),
    "brace missing": (change(LIN + r".*(\})", lambda _: ""), "krl-malformed"),
    "comma for point": (change(r"^LIN \{X (40.000)", lambda _: "40,000"), "krl-malformed"),
    "value twice": (change(r"^LIN \{(X) 40.000", lambda _: "Y"), "krl-malformed"),
    "other blending": (change(LIN + r".*\} (C_DIS)", lambda _: "C_VEL"), "krl-malformed"),
    "statement added": (insert("$OUT[9]=TRUE", LIN), "verify-statement"),
    "call added": (insert("GRIPPER ( )", LIN), "krl-call-undeclared"),
    "nonsense added": (insert("LET THERE BE LIGHT", LIN), "krl-unknown"),
    "RETURN added": (insert("RETURN", LIN), "verify-statement"),
    "not ASCII": (insert("; größer", LIN), "krl-not-ascii"),
    "not ASCII in a name": (change(r"^(LIN) \{X 40.000", lambda _: "LÏN"), "krl-not-ascii"),
    "DECL deleted": (delete(r"^DECL INT GK_HANDLE"), None),
    "INTERRUPT DECL deleted": (delete(r"^GLOBAL INTERRUPT DECL"), None),
    "declaration among motions": (insert("DECL INT I", LIN), None),
    "DEF renamed": (change(r"^DEF (PART)", lambda _: "OTHER"), None),
    "END missing": (delete(r"^END\s*$"), "krl-structure"),
    "second INITMOV": (insert("BAS (#INITMOV,0 )", LIN), "krl-initmov"),
}
SOMEWHERE_IN_THE_FILE = {"krl-structure", "krl-initmov"}
NEXT_MOTION = {"VEL.CP by 1 %", "VEL.CP deleted", "APO.CDIS", "dwell", "dwell deleted", "LIN deleted"}
"""Noticed at a motion that the changed line has a say in, not at the line itself."""


def tampered(made, edit):
    """Write the program with one edit; return the 1-based line of the edit."""
    lines = made.lines
    at = edit(lines)
    made.src.write_bytes(("\n".join(lines) + "\n").encode("utf-8"))
    return at + 1


def errors(report):
    return [issue for issue in report.issues if issue.severity == "error"]


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """One translated part for all edits; each begins from the bytes that were written."""
    made = Made(tmp_path_factory.mktemp("shared"))
    return made, made.src.read_bytes()


@pytest.fixture
def made(shared):
    made, source = shared
    made.src.write_bytes(source)
    return made


@pytest.mark.parametrize("name", TAMPERINGS)
def test_tampering_is_noticed(made, name):
    edit, code = TAMPERINGS[name]
    line = tampered(made, edit)
    report = made.verified()
    assert not report.ok
    found = [issue for issue in errors(report) if code in (None, issue.code)]
    assert found, [issue.text() for issue in errors(report)]
    motions = [k + 1 for k, text in enumerate(made.lines) if text.startswith(("LIN", "PTP"))]
    if name in NEXT_MOTION:
        before = max(k for k in motions if k < line)
        after = [k for k in motions if k >= line][:3]
        assert any(issue.line in (before, *after) for issue in found)
    elif code not in SOMEWHERE_IN_THE_FILE and name != "DECL deleted":
        while made.lines[line - 1].startswith(";FOLD"):  # a deleted line is missed at the next statement
            line += 1
        assert line in [issue.line for issue in found], [issue.text() for issue in found]


@pytest.mark.parametrize("name", list(TAMPERINGS)[::8])
def test_the_command_refuses_what_was_tampered_with(made, name, run):
    edit, code = TAMPERINGS[name]
    tampered(made, edit)
    assert f"[{code}]" in run("verify", made.src, made.part, "-q", code=1).err


def test_untouched_program_verifies(make, run):
    made = make()
    report = made.verified()
    assert report.ok
    assert report.motions == report.intended == len(made.targets)
    assert report.max_deviation_mm <= 0.001
    assert "agrees" in run("verify", made.src, made.part, code=0).out


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7, 0.9, 0.99])
def test_truncated_file_is_noticed(make, share):
    made = make()
    data = made.src.read_bytes()
    made.src.write_bytes(data[: int(share * len(data))])
    report = made.verified()
    assert not report.ok
    assert "krl-structure" in {issue.code for issue in errors(report)}


@pytest.mark.parametrize("text", [b"", b"hello\n", b"&ACCESS RVP\n; nothing\n"])
def test_no_program_at_all(make, text):
    made = make()
    made.src.write_bytes(text)
    with pytest.raises(NotUnderstoodError, match="no-def"):
        made.verified()


def test_program_of_another_part_is_noticed(make, tmp_path):
    made = make()
    other = make(stem="other", text=re.sub(r"X40\b", "X41", made.part.read_text()))
    assert not verified(other.src, made.toolpath, made.cell).ok
    assert verified(other.src, other.toolpath, made.cell).ok


def test_program_of_another_cell_is_noticed(make):
    made = make(data={"frames": {"base": {**OWN_CELL["frames"]["base"], "z_mm": 801.0}}})
    default = make(stem="usual")
    assert not verified(made.src, made.toolpath, default.cell).ok


def test_worst_lines_name_the_line_of_the_gcode(make):
    made = make()
    line = tampered(made, TAMPERINGS["X by 0.01 mm"][0])
    worst = made.verified().worst[0]
    assert worst["line"] == line
    assert worst["gcode_line"] == 10
    assert worst["deviation_mm"] == pytest.approx(0.01)


# --- laid out anew, but equal ---------------------------------------------------------------------------

REWRITINGS = {
    "lower case": str.lower,
    "no carriage returns": lambda text: text.replace("\r", ""),
    "indented": lambda text: re.sub(r"^(?=[^&;\r])", "   \t", text, flags=re.M),
    "trailing spaces": lambda text: text.replace("\r", "  \t\r"),
    "blank lines": lambda text: text.replace("\n", "\n\n"),
    "spaces around commas": lambda text: re.sub(r",(?=[XYZABCST]\d? )", " , ", text),
    "spaces inside braces": lambda text: text.replace("{", "{  ").replace("}", "  }"),
    "no space before braces": lambda text: re.sub(r"(?m)^(LIN|PTP) ", r"\1", text),
    "no space before C_DIS": lambda text: text.replace("} C_DIS", "}C_DIS"),
    "wide C_DIS": lambda text: text.replace("} C_DIS", "}    C_DIS"),
    "spaces around =": lambda text: re.sub(r"(?m)^(\$[A-Z.]+)=", r"\1 = ", text),
    "comments behind": lambda text: re.sub(r"(?m)^((?:LIN|PTP|\$VEL|END).*)\r", r"\1 ; by hand\r", text),
    "comments close behind": lambda text: re.sub(r"(?m)^(\$OUT.*|END)\r", r"\1; by hand\r", text),
    "comments removed": lambda text: re.sub(r"(?m)^;.*\r?\n", "", text),
    "wide WAIT  SEC": lambda text: text.replace("WAIT SEC", "WAIT  SEC"),
    "spaced calls": lambda text: text.replace("BAS (#INITMOV,0 )", "BAS(#INITMOV, 0)"),
    "components in another order": lambda text: re.sub(
        r"(?m)^(LIN|PTP) \{(X [^,]*),(Y [^,]*),(Z [^,]*),", r"\1 {\4,\2,\3,", text
    ),
    "fewer zeros": lambda text: re.sub(r"(?m)(?<= 0)\.0+(?=[,}]\S* ?C_DIS)", "", text),
    "more zeros": lambda text: text.replace("X 40.000", "X +040.0000"),
}


@pytest.mark.parametrize("name", REWRITINGS)
def test_equal_program_by_hand_verifies(make, name):
    made = make()
    text = made.text
    rewritten = REWRITINGS[name](text)
    assert rewritten != text
    made.src.write_bytes(rewritten.encode("ascii"))
    report = made.verified()
    assert report.ok, [issue.text() for issue in errors(report)]
    assert report.motions == report.intended


# --- long programs --------------------------------------------------------------------------------------

ZIGZAG = (
    "G21 G90 G54 G64 P0.02\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F900\n"
    + "".join(f"G1 X{10 * (k % 2)} Y{0.5 * k:.1f}{' F1200' if k % 50 == 0 else ''}\n" for k in range(450))
    + "G4 P0.5\nG0 Z20\nG0 X50\nG0 Z2\nG1 Z-1\nM8\nG1 X60\nG0 Z20\nM30\n"
)


def motions_of(src):
    """Return kind, components, blending, speed and distance of each motion."""
    found = read_program(src).motions
    return [(m.kind, m.values, m.blend, m.speed_m_s, m.cdis_mm if m.blend else 0.0) for m in found]


@pytest.mark.parametrize("split", ["defs", "files"])
@pytest.mark.parametrize("most", [100, 150, 5000])
def test_parts_of_a_long_program(make, tmp_path, split, most):
    whole = make(ZIGZAG, stem="whole")
    folder = tmp_path / split
    folder.mkdir()
    parts = type(whole)(folder, ZIGZAG, "whole", {"program": {"max_lines": most}}, split=split)
    assert motions_of(parts.src) == motions_of(whole.src)
    report = parts.verified()
    assert report.ok, [issue.text() for issue in errors(report)]
    assert report.motions == len(whole.targets)
    text = "".join(file.read_text("ascii") for file in folder.glob("*.src"))
    assert text.count("#INITMOV") == 1
    count = len(re.findall(r"(?m)^DEF ", text))
    assert count == len(re.findall(r"(?m)^END\s*$", text))
    assert count > 2 if most < 200 else count <= 2
    longest = max(len(re.findall(r"(?m)^(?:LIN|PTP)", part)) for part in text.split("DEF "))
    assert longest <= most
    files = sorted(file.name for file in folder.glob("*.src"))
    assert files == sorted(file.name for file in parts.program.files if file.suffix == ".src")
    assert (len(files) > 1) == (split == "files")


@pytest.mark.parametrize("split", ["defs", "files"])
def test_messages_in_parts_that_begin_in_a_blended_corner(make, tmp_path, split):
    """The variables of messages are set where the first message stops the robot, not at the part's start."""
    lines = ZIGZAG.splitlines()
    lines.insert(len(lines) * 3 // 4, "(MSG, nearly done)")
    part = "\n".join(lines) + "\n"
    made = make(part, data={"program": {"max_lines": 100}}, split=split)
    text = "".join(file.read_text("ascii") for file in tmp_path.rglob("*.src"))
    assert text.index('"nearly done"') > text.rindex("GK_PAR[1]={") > text.rindex("DECL KRLMSG_T")
    assert made.verified().ok
    usual = make(part, stem="usual")
    assert verified(made.src, made.toolpath, usual.cell).ok, "how it is split is no difference"


def test_each_verifies_with_the_cell_of_the_other(make, tmp_path):
    """How the text is laid out is no difference."""
    made = make(ZIGZAG, data={"program": {"max_lines": 100}})
    default = make(ZIGZAG, stem="usual")
    assert verified(made.src, made.toolpath, default.cell).ok
    assert verified(default.src, made.toolpath, made.cell).ok


@pytest.mark.parametrize("deed", ["missing", "swapped", "changed"])
def test_tampered_part_file_is_noticed(make, deed):
    made = make(ZIGZAG, data={"program": {"max_lines": 100}}, split="files")
    first, second = (
        made.program.files[1:3] if made.program.files[1].suffix == ".src" else made.program.files[2:4]
    )
    line = 0
    if deed == "missing":
        second.unlink()
    elif deed == "swapped":
        a, b = first.read_text("ascii"), second.read_text("ascii")
        first.write_text(b.replace("_002", "_001"), "ascii")
        second.write_text(a.replace("_001", "_002"), "ascii")
    else:
        lines = second.read_text("ascii").splitlines()
        line = line_of(lines, r"^LIN", 20)
        lines[line] = lines[line].replace("Z -1.000", "Z -1.010")
        second.write_text("\r\n".join(lines) + "\r\n", "ascii")
    report = made.verified()
    assert not report.ok
    if deed == "changed":
        found = [issue for issue in errors(report) if issue.code == "verify-position"]
        assert [issue.line for issue in found] == [line + 1]
        assert second.name in found[0].text(), "the line is of the part's file, which must be named"


def test_parts_end_at_a_standstill_where_one_is_near(make):
    """A subprogram ends between blended motions only where no standstill lies in its last fifth."""
    made = make(
        ZIGZAG.replace("G4 P0.5\n", "").replace("X10 Y45.5\n", "X10 Y45.5\nG4 P1\n"),
        data={"program": {"max_lines": 100}},
    )
    motions = made.targets.cdis_mm == 0
    assert np.count_nonzero(motions[80:100]) == 1
    first = made.src.read_text("ascii").split("DEF PART_001")[1].split("\nEND")[0]
    assert first.rstrip().splitlines()[-1] == "WAIT SEC 1.000 ; dwell"

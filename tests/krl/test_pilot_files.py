"""Files of a pilot force: sidecar, checksum, header, forms; what verification finds when they change."""

import re

import numpy as np
import pytest

from gcode2krl import Prediction, set_targets, write_krl
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.krl import windows
from gcode2krl.pilot import read_pilot
from tests.cells import over_demonstration
from tests.krl.conftest import PART, read, verified
from tests.krl.forces import cutting_below, moved, with_forces
from tests.krl.replay import read_program

pytestmark = pytest.mark.slow


def part(data=None, text=PART, dt_s=0.012):
    """Predict the part of the other tests, with forces and a deflection."""
    cell = over_demonstration(data)
    prediction = moved(read(text, cell), cell, dt_s)
    force = cutting_below(prediction, force_N=300.0)
    return with_forces(prediction, force, force / 400.0)


@pytest.fixture
def made(tmp_path):
    """Write the part to ``part.src`` with options; returns prediction, program and file."""

    def write(prediction=None, name="part.src", **options):
        prediction = prediction or part()
        return prediction, write_krl(prediction, tmp_path / name, **options), tmp_path / name

    return write


def errors(report):
    return {issue.code for issue in report.issues if issue.severity == "error"}


# --- files ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["index", "values"])
def test_three_files_that_belong_together(made, form, tmp_path):
    prediction, program, src = made(pilot=form)
    assert [file.name for file in program.files] == ["part.src", "part.dat", "part.pilot.csv"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["part.dat", "part.pilot.csv", "part.src"]
    knots, header = read_pilot(tmp_path / "part.pilot.csv")
    stated = re.findall(r"(?m)^\$SEN_PINT\[2\]=(\d+)$", src.read_text("ascii"))
    assert [int(word) for word in stated] == [header.checksum]
    assert 0 < header.checksum < 2**31
    assert (header.form, header.frame, header.lead_s) == (form, "tcp", 0.04)
    assert header.variable == {"index": "$SEN_PINT[1]", "values": "$SEN_PREA"}[form]
    assert len(knots) == program.pilot.knots > 20
    lines = prediction.toolpath.source_line[prediction.motion.move]
    rows = np.rint(knots.time_s / 0.012).astype(int)
    assert knots.line.tolist() == lines[rows].tolist()
    assert knots.path_mm == pytest.approx(prediction.motion.path_mm[rows], abs=1e-6)
    assert knots.deflection_mm == pytest.approx(knots.force_N / 400, abs=3e-5)


def test_the_checksum_stands_before_any_motion_and_once(made):
    _, _, src = made()
    program = read_program(src)
    where = [k for k, motion in enumerate(program.motions) if any("SEN_PINT[2]" in s for s in motion.before)]
    assert where == [0]
    assert "$SEN_PINT[1]=-1" in program.motions[0].before


def test_header_of_the_program(made):
    _, program, src = made()
    head = src.read_text("ascii").split("DECL")[0]
    assert "Predictions of time, lead and force hold at 100 % override only." in head
    assert (
        f"; pilot force: gcode2krl/pilot/1, form index, {program.pilot.knots} knots in $SEN_PINT[1]" in head
    )
    assert "frame tcp" in head
    assert "announced 0.040 s ahead" in head
    assert "knots in PART.pilot.csv" in head
    assert "chatter" in head
    assert "material removal" not in head


def test_without_forces_nothing_changes(tmp_path):
    prediction = part()
    bare = Prediction(prediction.toolpath, prediction.targets, prediction.cell, prediction.motion)
    plain = write_krl(bare, tmp_path / "part.src")
    targets = write_krl(prediction.targets, tmp_path / "part.src", prediction.cell)
    assert plain.texts == targets.texts
    assert plain.pilot is None
    assert "TRIGGER" not in plain.texts["PART.src"].decode("ascii")
    assert "Predicted\r\n; times hold at 100 % override only" in plain.texts["PART.src"].decode("ascii")


def test_pilot_none_leaves_the_motions_alone(made):
    prediction, program, src = made(pilot="none")
    assert program.pilot is None
    assert [file.suffix for file in program.files] == [".src", ".dat"]
    text = src.read_text("ascii")
    assert "TRIGGER" not in text
    assert "SEN_PINT" not in text
    assert verified(src, prediction.toolpath, prediction.cell).ok


def test_the_cell_decides_the_form(made, tmp_path):
    _, program, _ = made(part({"pilot": {"form": "none"}}))
    assert program.pilot is None
    data = {"pilot": {"form": "values", "value_variable": "$SEN_PREA", "lead_s": 0.06, "frame": "base"}}
    _, program, _ = made(part(data))
    _, header = read_pilot(tmp_path / "part.pilot.csv")
    assert (header.form, header.lead_s, header.frame) == ("values", 0.06, "base")
    assert program.pilot.min_lead_s >= 0.06


def test_names_of_the_cell(made, tmp_path):
    data = {"pilot": {"index_variable": "KNOT", "hash_variable": "CHECKSUM"}}
    prediction, _, src = made(part(data))
    text = src.read_text("ascii")
    assert re.search(r"DO KNOT=0$", text, re.M)
    assert re.search(r"^CHECKSUM=\d+$", text, re.M)
    assert "SEN_PINT" not in text
    assert verified(src, prediction.toolpath, prediction.cell).ok


def test_standard_output():
    """No sidecar: none by default, values on request, index refused."""
    prediction = part()
    assert write_krl(prediction, None, name="OUT").pilot is None
    program = write_krl(prediction, None, name="OUT", pilot="values")
    assert set(program.texts) == {"OUT.src"}
    text = program.texts["OUT.src"].decode("ascii")
    assert text.count("DO GK_PILOT(") == program.pilot.knots
    assert "DEF GK_PILOT(" in text
    assert "pilot.csv" not in text
    with pytest.raises(NotUnderstoodError, match=r"index needs the sidecar.*-o part\.src"):
        write_krl(prediction, None, name="OUT", pilot="index")


def test_targets_have_no_forces(tmp_path):
    prediction = part()
    with pytest.raises(NotUnderstoodError, match="Targets have no forces"):
        write_krl(prediction.targets, tmp_path / "part.src", prediction.cell, pilot="index")
    bare = Prediction(prediction.toolpath, prediction.targets, prediction.cell, prediction.motion)
    with pytest.raises(NotUnderstoodError, match="no forces to pilot with"):
        write_krl(bare, tmp_path / "part.src", pilot="index")
    assert list(tmp_path.iterdir()) == []


def test_forces_that_are_zero_have_no_knots(made, tmp_path):
    prediction = part()
    prediction = with_forces(prediction, np.zeros((len(prediction.motion), 3)))
    _, program, src = made(prediction)
    assert program.pilot.knots == 0
    assert program.pilot.min_lead_s is None
    knots, _ = read_pilot(tmp_path / "part.pilot.csv")
    assert len(knots) == 0
    assert verified(src, prediction.toolpath, prediction.cell).ok


def test_a_motion_of_other_targets_is_refused(tmp_path):
    prediction = part()
    other = set_targets(read(PART.replace("X40", "X60"), prediction.cell), prediction.cell)
    wrong = Prediction(
        prediction.toolpath, other, prediction.cell, prediction.motion, forces=prediction.forces
    )
    with pytest.raises(RefusedError, match="pilot-motion"):
        write_krl(wrong, tmp_path / "part.src", pilot="index")
    bare = write_krl(wrong, tmp_path / "part.src")
    assert bare.pilot is None
    assert "pilot-left-out" in {issue.code for issue in bare.issues}


def test_a_position_alone(tmp_path):
    """A program without any move that could carry a trigger."""
    cell = over_demonstration()
    prediction = moved(read("G21 G90 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z50\nM30\n", cell), cell)
    forced = with_forces(prediction, np.zeros((len(prediction.motion), 3)))
    assert write_krl(forced, tmp_path / "part.src").pilot.knots == 0


@pytest.mark.parametrize("split", ["defs", "files"])
@pytest.mark.parametrize("form", ["index", "values"])
def test_parts_of_a_long_program(made, split, form):
    """Each file has its own copy of the subprogram; the checksum does not depend on how the text is cut."""
    lines = "".join(f"G1 X{2 * k % 90} Y{k // 45}\n" for k in range(400))
    text = (
        f"G21 G90 G54 G64\nT1 M6\nS8000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\nG1 Z-1 F900\n{lines}G0 Z20\nM30\n"
    )
    whole, _, src = made(part(text=text), pilot=form)
    stated = re.search(r"\$SEN_PINT\[2\]=(\d+)", src.read_text("ascii"))[1]
    prediction = part({"program": {"max_lines": 100}}, text)
    _, program, src = made(prediction, pilot=form, split=split)
    assert re.search(r"\$SEN_PINT\[2\]=(\d+)", src.read_text("ascii"))[1] == stated
    report = verified(src, prediction.toolpath, prediction.cell)
    assert report.ok, [issue.text() for issue in report.issues]
    assert report.pilot.knots == program.pilot.knots
    texts = [file.read_text("ascii") for file in program.files if file.suffix == ".src"]
    assert len(texts) == (1 if split == "defs" else len(program.files) - 2)
    for own in texts[1:]:
        assert ("DEF GK_PILOT" in own) == ("DO GK_PILOT(" in own)
    assert verified(src, prediction.toolpath, whole.cell).ok


@pytest.mark.parametrize("dt_s", [0.012, 0.004])
def test_sample_time_of_the_prediction(made, dt_s):
    prediction, program, src = made(part(dt_s=dt_s))
    assert program.pilot.min_lead_s >= 0.04
    assert verified(src, prediction.toolpath, prediction.cell).ok


def test_a_tool_measured_along_x(made, tmp_path):
    """Knots are stated in the axes of $TOOL as the controller has it: x points from tip to holder."""
    frame = {"x_mm": 250.0, "y_mm": 0.0, "z_mm": 250.0, "a_deg": 180.0, "b_deg": 0.0, "c_deg": 180.0}
    tool = {"axis": "+x", "frame": frame}
    prediction, _, src = made(part({"tool": {"1": tool, "2": tool}}))
    knots, _ = read_pilot(tmp_path / "part.pilot.csv")
    force = prediction.forces.force_base_N[np.rint(knots.time_s / 0.012).astype(int)]
    assert knots.force_N[:, 0] == pytest.approx(force[:, 2], abs=0.011)
    assert np.linalg.norm(knots.force_N, axis=1) == pytest.approx(np.linalg.norm(force, axis=1), abs=0.02)
    assert verified(src, prediction.toolpath, prediction.cell).ok


def test_where_a_delay_begins_is_one_constant(made, monkeypatch):
    """From the start of the arc instead of its end: another program, and each refuses the other's."""
    text = PART.replace("G64 P0.02", "G64 P1")
    monkeypatch.setattr(windows, "COUNTS_FROM_END_OF_ARC", False)
    prediction, program, src = made(part(text=text))
    assert verified(src, prediction.toolpath, prediction.cell).ok
    assert program.pilot.min_lead_s >= 0.04
    monkeypatch.undo()
    assert "pilot-lead" in errors(verified(src, prediction.toolpath, prediction.cell))


# --- what verification finds -----------------------------------------------------------------------------


def edit(pattern, replacement, occurrence=0):
    """Return an edit of the first group of a match in the text."""

    def change(text):
        found = list(re.finditer(pattern, text, re.M))[occurrence]
        new = replacement(found[1]) if callable(replacement) else replacement
        return text[: found.start(1)] + new + text[found.end(1) :]

    return change


TRIGGER = r"^(TRIGGER .*\r?\n)"
TARGET = r"^(LIN \{X 20\.000,Y 40)"
TAMPERINGS = {
    "later": (edit(r"DELAY=(\d+)", lambda word: str(int(word) + 9), 3), "pilot-lead"),
    "much earlier": (edit(r"DELAY=(\d{3,})", lambda word: str(int(word) - 20), 3), "pilot-lead"),
    "negative": (edit(r"DELAY=(\d+)", "-5", 3), "pilot-knot"),
    "half a millisecond": (edit(r"DELAY=(\d+)", "7.5", 3), "pilot-knot"),
    "beyond the motion": (edit(r"DELAY=(\d+)", "90000", 3), "pilot-window"),
    "at the end": (edit(r"DISTANCE=(0)", "1", 2), "pilot-knot"),
    "number twice": (edit(r"SEN_PINT\[1\]=(4)\r", "3"), "pilot-knot"),
    "another variable": (edit(r"DO \$SEN_PINT\[(1)\]=4\r", "3"), "pilot-form"),
    "deleted": (edit(TRIGGER, "", 5), "pilot-count"),
    "doubled": (edit(TRIGGER, lambda line: line + line, 5), "pilot-count"),
    "path instead": (edit(r"WHEN (DISTANCE)=0", "PATH", 5), "pilot-count"),
    "an output instead": (edit(r"DO (\$SEN_PINT\[1\])=4", "$OUT[7]"), "pilot-form"),
    "outside of a trigger": (edit(TARGET, lambda lin: f"$SEN_PINT[1]=9\r\n{lin}"), "krl-blend-broken"),
    "checksum": (edit(r"SEN_PINT\[2\]=(\d+)", "7"), "pilot-checksum"),
    "no checksum": (edit(r"^(\$SEN_PINT\[2\]=\d+\r\n)", ""), "pilot-checksum"),
    "checksum later": (edit(TARGET, lambda lin: f"$SEN_PINT[2]=9\r\n{lin}"), "pilot-checksum"),
    "a target by a micrometre": (edit(TARGET, "LIN {X 20.001,Y 40"), "pilot-checksum"),
    "a target by more": (edit(TARGET, "LIN {X 20.010,Y 40"), "verify-position"),
    "speed": (edit(r"^\$VEL\.CP=(0\.0250000)", "0.0240000"), "verify-speed"),
}


@pytest.mark.parametrize("name", TAMPERINGS)
def test_tampering_is_noticed(made, name):
    change, code = TAMPERINGS[name]
    prediction, _, src = made()
    text = src.read_bytes().decode("ascii")
    changed = change(text)
    assert changed != text
    src.write_bytes(changed.encode("ascii"))
    report = verified(src, prediction.toolpath, prediction.cell)
    assert code in errors(report), [issue.text() for issue in report.issues]
    lines = {issue.line for issue in report.issues if issue.code == code}
    first = 1 + next(
        k for k, (a, b) in enumerate(zip(text.splitlines(), changed.splitlines(), strict=False)) if a != b
    )
    if code not in ("pilot-count", "pilot-checksum", "pilot-form", "verify-speed"):
        assert first in lines


VALUES = {
    "force": (
        edit(r"GK_PILOT\((-?[\d.]+),.*PRIO", lambda word: f"{float(word) + 0.01:.2f}", 4),
        "pilot-knot",
    ),
    "seconds": (edit(r",([\d.]+)\) PRIO", lambda word: f"{float(word) + 0.001:.4f}", 4), "pilot-knot"),
    "priority": (edit(r"(PRIO=-1)", "PRIO=1", 4), "pilot-count"),
    "subprogram": (edit(r"^\$SEN_PREA\[(2)\]=GK", "1"), "verify-statement"),
    "subprogram deleted": (edit(r"^(DEF GK_PILOT[\s\S]*?END\r\n)", ""), "verify-statement"),
}


@pytest.mark.parametrize("name", VALUES)
def test_tampering_with_values_is_noticed(made, name):
    change, code = VALUES[name]
    prediction, _, src = made(pilot="values")
    text = src.read_bytes().decode("ascii")
    src.write_bytes(change(text).encode("ascii"))
    report = verified(src, prediction.toolpath, prediction.cell)
    assert code in errors(report), [issue.text() for issue in report.issues]


@pytest.mark.parametrize("form", ["index", "values"])
@pytest.mark.parametrize(
    "change",
    [
        str.lower,
        lambda text: re.sub(r"(?m)^(TRIGGER.*)\r", r"\1 ; by hand\r", text),
        lambda text: text.replace("TRIGGER WHEN DISTANCE=0 DELAY=", "  TRIGGER  WHEN DISTANCE = 0  DELAY = "),
        lambda text: text.replace("PRIO=-1", " PRIO = -1").replace("$SEN_PINT[1]=", "$SEN_PINT[1] = "),
    ],
    ids=["lower case", "comments", "spaces", "spaces behind"],
)
def test_equal_program_by_hand_verifies(made, form, change):
    prediction, _, src = made(pilot=form)
    text = src.read_bytes().decode("ascii")
    changed = change(text)
    src.write_bytes(changed.encode("ascii"))
    report = verified(src, prediction.toolpath, prediction.cell)
    assert report.ok, [issue.text() for issue in report.issues]


def sidecar_edit(row, column, word):
    def change(lines):
        words = lines[row].split(",")
        words[column] = word
        lines[row] = ",".join(words)

    return change


def head(pattern, new):
    def change(lines):
        lines[0] = re.sub(pattern, new, lines[0])

    return change


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (sidecar_edit(6, 5, "123.45"), "pilot-checksum"),
        (sidecar_edit(6, 4, "0.3000"), "pilot-lead"),
        (lambda lines: lines.pop(), "pilot-count"),
        (head("checksum=.*", "checksum=77"), "pilot-checksum"),
        (head("form=index", "form=values"), "pilot-form"),
    ],
    ids=["force", "lead", "knot deleted", "checksum", "form"],
)
def test_changed_sidecar_is_noticed(made, tmp_path, change, code):
    prediction, _, src = made()
    file = tmp_path / "part.pilot.csv"
    lines = file.read_text("ascii").splitlines()
    change(lines)
    file.write_text("\n".join(lines) + "\n", encoding="ascii")
    found = errors(verified(src, prediction.toolpath, prediction.cell))
    assert code in found


def test_sidecar_of_another_program(made, tmp_path):
    """A mixed pair: the same knots, one target elsewhere."""
    prediction, _, src = made()
    made(part(text=PART.replace("X20 Y40", "X20 Y40.2")), name="other.src")
    (tmp_path / "part.pilot.csv").write_bytes((tmp_path / "other.pilot.csv").read_bytes())
    assert "pilot-checksum" in errors(verified(src, prediction.toolpath, prediction.cell))


def test_missing_sidecar(made, tmp_path):
    prediction, _, src = made()
    (tmp_path / "part.pilot.csv").unlink()
    report = verified(src, prediction.toolpath, prediction.cell)
    issue = next(issue for issue in report.issues if issue.code == "pilot-sidecar")
    assert "part.pilot.csv is missing" in issue.message
    assert src.read_text("ascii").splitlines()[issue.line - 1].startswith("TRIGGER")


def test_unreadable_sidecar(made, tmp_path):
    prediction, _, src = made()
    (tmp_path / "part.pilot.csv").write_text("knot;force\n", encoding="ascii")
    with pytest.raises(NotUnderstoodError, match="pilot-file"):
        verified(src, prediction.toolpath, prediction.cell)


def test_figures_for_other_programs(made):
    prediction, program, src = made()
    figures = program.pilot.as_dict()
    assert set(figures) == {
        "knots",
        "tolerance_N",
        "max_error_N",
        "rms_error_N",
        "min_lead_s",
        "max_active",
    }
    assert program.report.as_dict()["pilot"] == figures
    read_back = verified(src, prediction.toolpath, prediction.cell).as_dict()["pilot"]
    assert read_back["max_error_N"] is None
    assert read_back["knots"] == figures["knots"]
    assert "pilot" not in verified(made(pilot="none")[2], prediction.toolpath, prediction.cell).as_dict()


def test_every_byte_is_fit_for_the_controller(made):
    for form in ("index", "values"):
        _, program, _ = made(pilot=form)
        for file in program.files[:2]:
            data = file.read_bytes()
            assert data.isascii()
            assert data.count(b"\r") == data.count(b"\n") == data.count(b"\r\n")
            assert max(map(len, data.splitlines())) < 472


def test_same_input_same_bytes(made):
    first = made()[1].texts
    assert made()[1].texts == first

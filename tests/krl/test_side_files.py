"""What verify says of the files beside a program, of HOME, and of every deleted statement."""

import re

import numpy as np
import pytest

from gcode2krl.krl import write_krl
from gcode2krl.pipeline import predict_toolpath
from tests.krl.conftest import verified
from tests.krl.test_verify import ZIGZAG, errors

pytestmark = pytest.mark.slow


def check(made, src=None):
    return verified(src or made.src, made.toolpath, made.cell)


def statements(text):
    """Return the numbers of the lines that say something to a controller."""
    lines = text.split("\r\n")
    return [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith((";", "&"))]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [".src", ".dat"])
def test_every_deleted_statement_is_noticed(make, kind):
    made = make()
    file = made.src.with_suffix(kind)
    text = file.read_bytes().decode("ascii")
    lines = text.split("\r\n")
    rows = statements(text)
    assert len(rows) > (90 if kind == ".src" else 3)
    unnoticed = []
    for row in rows:
        file.write_bytes("\r\n".join([*lines[:row], *lines[row + 1 :]]).encode("ascii"))
        try:
            noticed = not check(made).ok
        except Exception as error:  # one without any DEF is no program at all
            noticed = "no-def" in str(error)
        unnoticed += [] if noticed else [lines[row]]
    assert unnoticed == []
    file.write_bytes(text.encode("ascii"))
    assert check(made).ok


CHANGES = {
    "EXT BAS removed": (lambda t: t.replace("EXT BAS (BAS_COMMAND :IN,REAL :IN )\r\n", ""), "krl-data"),
    "EXT BAS changed": (lambda t: t.replace("REAL :IN )", "REAL :OUT )"), "krl-data"),
    "another name": (lambda t: t.replace("DEFDAT PART", "DEFDAT PARTS"), "krl-data"),
    "public": (lambda t: t.replace("DEFDAT PART", "DEFDAT PART PUBLIC"), "krl-data"),
    "a variable added": (lambda t: t.replace("ENDDAT", "DECL INT I=1\r\nENDDAT"), "krl-data"),
    "lines swapped": (lambda t: t.replace("ENDDAT", "").replace("DEFDAT", "ENDDAT\r\nDEFDAT"), "krl-data"),
    "a fold open": (lambda t: t.replace(";ENDFOLD (BASISTECH EXT)", "; nothing"), "krl-structure"),
    "cut off": (lambda t: t[: t.index("ENDDAT")], "krl-data"),
    "empty": (lambda t: "", "krl-data"),
    "not ASCII": (lambda t: t.replace("ENDDAT", "; größe\r\nENDDAT"), "krl-not-ascii"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_data_list_is_noticed(make, name):
    made = make()
    change, code = CHANGES[name]
    data = made.src.with_suffix(".dat")
    changed = change(data.read_bytes().decode("ascii"))
    data.write_bytes(changed.encode("utf-8"))
    found = errors(check(made))
    assert code in [issue.code for issue in found]
    assert all("part.dat" in issue.message for issue in found)


@pytest.mark.parametrize(
    "change",
    [
        str.lower,
        lambda t: t.replace("\r\n", "\n"),
        lambda t: t.replace(" :IN", ":IN"),
        lambda t: t.replace("ENDDAT", "; by hand\r\nENDDAT ; the end"),
        lambda t: "\r\n" + t,
    ],
)
def test_a_data_list_laid_out_anew_is_the_same(make, change):
    made = make()
    data = made.src.with_suffix(".dat")
    data.write_bytes(change(data.read_bytes().decode("ascii")).encode("ascii"))
    assert check(made).ok


def test_names_in_another_case_are_found(make, tmp_path):
    """A controller's Windows writes them as it likes."""
    made = make()
    made.src.with_suffix(".dat").rename(tmp_path / "PART.DAT")
    assert check(made).ok


def test_a_program_with_its_declarations_inside_needs_no_data_list(make, tmp_path):
    made = make()
    alone = write_krl(made.targets, None, made.cell, name="PART")
    (tmp_path / "alone").mkdir()
    src = tmp_path / "alone" / "part.src"
    src.write_bytes(alone.texts["PART.src"])
    assert check(made, src).ok


# --- missing files ----------------------------------------------------------------------------------------


@pytest.fixture
def with_pilot(make, tmp_path):
    """Return a function that writes the part with a pilot force of a form; its .src."""

    def write(form):
        made = make()
        prediction = predict_toolpath(made.toolpath, made.cell)
        src = tmp_path / "piloted" / "part.src"
        src.parent.mkdir(exist_ok=True)
        write_krl(prediction, src, pilot=form)
        return made, src

    return write


@pytest.mark.parametrize("form", ["index", "values"])
def test_a_missing_sidecar_is_named_and_nothing_else(with_pilot, form):
    made, src = with_pilot(form)
    assert check(made, src).ok
    src.with_suffix(".pilot.csv").unlink()
    report = check(made, src)
    assert [(issue.code, "part.pilot.csv" in issue.message) for issue in errors(report)] == [
        ("pilot-sidecar", True)
    ]
    assert report.max_deviation_mm <= 0.001, "the motions are compared all the same"


def test_a_bad_line_is_told_apart_from_a_missing_sidecar(with_pilot):
    made, src = with_pilot("index")
    src.with_suffix(".pilot.csv").unlink()
    text = src.read_bytes()
    assert b"$OUT[1]=TRUE" in text
    src.write_bytes(text.replace(b"$OUT[1]=TRUE", b"$OUT[1]=FALSE", 1))
    assert {issue.code for issue in errors(check(made, src))} == {"pilot-sidecar", "verify-statement"}


def test_a_missing_data_list_is_named_and_nothing_else(make):
    made = make()
    made.src.with_suffix(".dat").unlink()
    found = errors(check(made))
    assert [issue.code for issue in found] == ["krl-data"]
    assert "part.dat is missing" in found[0].message


def test_missing_parts_are_named_and_nothing_else(make):
    made = make(ZIGZAG, data={"based_on": "demonstration", "program": {"max_lines": 100}}, split="files")
    parts = [file for file in made.program.files if re.search(r"_\d{3}\.src$", file.name)]
    assert len(parts) > 3
    for part in parts[1:3]:
        part.unlink()
    report = check(made)
    found = errors(report)
    assert {issue.code for issue in found} == {"krl-part"}
    assert [part.name for part in parts[1:3] for issue in found if part.name in issue.message] == [
        part.name for part in parts[1:3]
    ]
    assert len(found) == 2
    assert np.isnan(report.max_deviation_mm)
    assert report.as_dict()["max_deviation_mm"] is None


# --- HOME and differences ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("A2 -90.0000", "A2 -89.9900"), ["A2 is -89.9900, intended -90.0000 deg"]),
        (("A3 90.0000", "A3 9.0000"), ["A3 is 9.0000, intended 90.0000 deg"]),
        (("A5 0.0000,A6 0.0000", "A5 1.0,A6 -2.5"), ["A5 is 1.0000, intended", "A6 is -2.5000, intended"]),
        ((",A6 0.0000", ""), ["A6 is missing, intended"]),
    ],
)
def test_the_axis_of_home_that_differs_is_named(make, run, change, words):
    made = make()
    made.src.write_bytes(made.src.read_bytes().replace(change[0].encode(), change[1].encode(), 1))
    found = [issue for issue in errors(check(made)) if issue.code == "verify-position"]
    assert len(found) == 1
    assert found[0].line > 0
    assert [word for word in words if word not in found[0].message] == []
    done = run("verify", made.src, made.part, code=1)
    assert "nan" not in (done.out + done.err).lower()


def test_home_as_a_pose_is_not_a_number_of_mm(make, run):
    made = make()
    text = made.src.read_text("ascii")
    home = re.search(r"PTP \{A1[^}]*\}", text).group(0)
    made.src.write_text(text.replace(home, "PTP {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 6,T 18}", 1))
    found = [issue.message for issue in errors(check(made)) if issue.code == "verify-position"]
    assert found == ["HOME is not given by its joints, A1 to A6"]
    done = run("verify", made.src, made.part)
    assert "nan" not in (done.out + done.err).lower()


def test_one_motion_too_few_is_one_finding(make):
    made = make()
    lines = made.src.read_text("ascii").splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith("LIN {X 40.000,Y 0.000,Z -2"))
    made.src.write_text("\r\n".join([*lines[:row], *lines[row + 1 :]]) + "\r\n")
    found = errors(check(made))
    assert [issue.code for issue in found] == ["verify-count"]
    assert found[0].line == row + 1


def test_a_moved_statement_is_told_by_its_place(make):
    made = make()
    lines = made.src.read_text("ascii").splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith("$OUT[3]=TRUE"))
    motion = next(k for k, line in enumerate(lines) if k > row and line.startswith("PTP"))
    moved = [*lines[:row], *lines[row + 1 : motion + 1], lines[row], *lines[motion + 1 :]]
    made.src.write_text("\r\n".join(moved) + "\r\n")
    messages = [issue.message for issue in errors(check(made)) if issue.code == "verify-statement"]
    assert any("stands behind motion" in message for message in messages)


def test_a_missing_component_is_no_number(make):
    made = make()
    text = made.src.read_text("ascii")
    made.src.write_text(re.sub(r"(LIN \{X 40\.000,Y 30\.500),Z [-0-9.]+", r"\1", text, count=1))
    found = errors(check(made))
    assert "krl-incomplete" in {issue.code for issue in found}
    assert not any("nan" in issue.message for issue in found)

"""The remedies of the reader's findings work when they are followed literally."""

import tomllib
from pathlib import Path

import pytest

from gcode2krl import Gcode2KrlError
from gcode2krl.gcode.dialects import REASONS
from gcode2krl.gcode.findings import all_findings
from tests.cells import over_demonstration
from tests.gcode import Control, read, refusal

HEAD, END = "G21\nG0 X0 Y0 Z5\n", "G0 X1\nM2\n"


def errors(text):
    """Return the findings for which a program is refused, but its warnings."""
    try:
        read(text)
    except Gcode2KrlError as error:
        return [issue for issue in error.issues if issue.severity != "warning"]
    return []


@pytest.mark.parametrize(
    ("line", "remedy", "mended"),
    [
        ("( hole at (0, 0) )", "without the inner ( and )", "( hole at 0, 0 )"),
        ("G1 X5 F100 *57", "no checksums", "G1 X5 F100"),
        (":1000", "O1000", "O1000"),
        ("% part", "% alone", "%"),
        ("G1 X5,5 F100", "decimal point", "G1 X5.5 F100"),
        ("G1 X5 F100 )", "remove the )", "G1 X5 F100"),
        ("G1 G1 X5 F100", "keep one", "G1 X5 F100"),
        ("//G1 X5 F100", "remove it", "/G1 X5 F100"),
        ("/ / G1 X5 F100", "remove it", "/G1 X5 F100"),
        ("M5 M5", "keep one", "M5"),
    ],
)
def test_the_remedy_names_what_helps_and_it_helps(line, remedy, mended):
    found = errors(f"{HEAD}{line}\n{END}")
    assert any(issue.line == 3 and remedy in issue.remedy for issue in found)
    assert not errors(f"{HEAD}{mended}\n{END}")


def test_the_caret_stands_before_the_inner_comment():
    assert "(hole at ^(0, 0) )" in refusal(f"{HEAD}(ok) (hole at (0, 0) )\n{END}").excerpt


def test_a_code_that_stands_twice_is_not_said_to_exclude_itself():
    assert "G1 stands twice" in refusal(f"{HEAD}G1 G1 X5 F100\n{END}").message


def test_lines_that_end_in_cr_alone_are_one_finding_that_says_so():
    (found,) = errors((HEAD + END).replace("\n", "\r"))
    assert (found.code, found.line) == ("line-ends", 1)
    assert "LF" in found.remedy


def test_one_consequence_is_one():
    found = errors(f"{HEAD}G1 A3 F100\nG1 A4\n{END}")
    (counted,) = [issue for issue in found if issue.code == "consequences"]
    assert counted.message == "1 more finding rests on the errors above and is not listed"


@pytest.mark.parametrize(
    "text",
    [
        "%\nO0001\n" + HEAD + END + "%\n",
        "%\nO0001 (PART)\n" + HEAD + END,
        "O1000\n" + HEAD + END,
        HEAD + "(45° Ø6 – „gut“)\nG1 X4 F100 ; 90°\n" + END,
        HEAD + END + "\x1a",
        (HEAD + END).replace(" ", "\t"),
        "\n \n\t\n" + HEAD + END,
        HEAD + "G1 X4 F100" + " " * 400 + "Y1\n" + END,
        "N100000 G21\nN9999999999 G0 X0 Y0 Z5\nG0Z5\n" + END,
        HEAD + "M06 T01\nS1000 M3 G4 P3\nG1 F1000\n" + END,
    ],
)
def test_what_posts_write_is_read(text):
    assert not errors(text)


REMEDIES = tomllib.loads(Path(__file__).with_name("remedies.toml").read_text(encoding="utf-8"))
BEFORE = {
    "linuxcnc": "G21 G90 G17 G94\nG54\nT1 M6\nG43 H1\nS8000 M3\nG0 X0 Y0 Z0\nF500\n",
    "fanuc": "G21 G90 G17 G94\nG54\nT1 M6\nG43 H1\nS8000 M3\nG0 X0. Y0. Z0.\nF500\n",
    "heidenhain": "0 BEGIN PGM P MM\n1 TOOL CALL 1 Z S8000 F500\n2 L X+0 Y+0 Z+0 R0 FMAX M3\n",
    "grbl": "",
    "sinumerik": "G710 G90 G17 G94\nG54\nT1 M6\nD1\nS8000 M3\nG0 X0 Y0 Z0\nF500\n",
}


def outcome(entry, lines, cell):
    """Return the findings of some lines behind a head, and the last place (none if refused)."""
    dialect = entry.get("dialect", "linuxcnc")
    head = "G21 G90 G17\n" if entry.get("whole") else BEFORE[dialect]
    control = Control(head, "99 END PGM P MM" if dialect == "heidenhain" else "M30", dialect)
    try:
        toolpath = control.read(lines, over_demonstration(cell))
    except Gcode2KrlError as error:
        return error.issues, None
    return [i for i in toolpath.issues if i.severity != "note"], toolpath.position_mm[-1].tolist()


@pytest.mark.parametrize("code", REMEDIES["code"])
def test_who_follows_a_remedy_gets_the_program_it_promises(code):
    entry = REMEDIES["code"][code]
    refused, _ = outcome(entry, entry["refused"], None)
    assert code in {issue.code for issue in refused}
    found, tip = outcome(entry, entry["mended"], entry.get("cell"))
    assert code not in {issue.code for issue in found}
    assert tip == pytest.approx(entry["tip"], abs=1e-9)


@pytest.mark.parametrize("name", REMEDIES["reason"])
def test_who_follows_the_remedy_of_a_reason_gets_the_program_it_promises(name):
    entry = REMEDIES["reason"][name]
    refused, _ = outcome(entry, entry["refused"], entry.get("of"))
    assert any(entry["says"] in issue.message + issue.remedy for issue in refused)
    found, tip = outcome(entry, entry["mended"], entry.get("cell") or entry.get("of"))
    assert not {issue.code for issue in found} & {"dialect-code", "dialect-statement"}
    assert tip == pytest.approx(entry["tip"], abs=1e-9)


def test_every_finding_of_the_reader_has_its_remedy_carried_out():
    told = REMEDIES["code"].keys() | REMEDIES["elsewhere"].keys()
    assert {finding.code for finding in all_findings().values()} == told


def test_every_reason_has_its_remedy_carried_out():
    entries = [*REMEDIES["reason"].values(), *REMEDIES["code"].values()]
    refused = [outcome(entry, entry["refused"], entry.get("of"))[0] for entry in entries]
    told = {issue.message for issues in refused for issue in issues}
    assert not [reason for reason, _ in REASONS if not any(reason in message for message in told)]

"""`gcode2krl models confirm`: who is asked what, and what is written."""

import json
import sys

import pytest

from gcode2krl import load_cell
from gcode2krl.cell.fingerprint import values_by_section
from tests.cli import on_a_terminal
from tests.conftest import ROOT

SOURCE = ROOT / "examples" / "cells" / "spindle_on_analog_output.toml"
AT_TERMINAL = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
CONFIRM = ("models", "confirm", "cell.toml")


@pytest.fixture
def cell_file(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_bytes(SOURCE.read_bytes())
    return file


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "nothing is confirmed: there is no terminal"),
        (("--by", "A"), "nothing is confirmed: there is no terminal"),
        (("--yes",), "--yes without a name"),
        (("--by", "A", "--yes", "--section", "frame"), "the cell has no 'frame'"),
        (("--by", "A", "--yes", "--date", "2026-02-30"), "2026-02-30 is not a date"),
        (("--by", "A\nB", "--yes"), "--by"),
        (("--by", "", "--yes"), "--yes without a name"),
    ],
)
def test_nothing_is_confirmed_by_nobody(run, cell_file, words, told):
    done = run(*CONFIRM, *words, code=2)
    assert told in done.err
    assert "-> " in done.err
    assert cell_file.read_bytes() == SOURCE.read_bytes()


def test_a_script_confirms_what_a_person_has_compared(run, cell_file):
    done = run(*CONFIRM, "--by", "A", "--yes", "--date", "2026-11-28", "--json")
    record = json.loads(done.out)
    assert (done.code, record["verified"], record["declined"]) == (0, True, [])
    assert record["confirmed"] == list(values_by_section(load_cell(cell_file)))
    signed = cell_file.read_bytes()
    assert run(*CONFIRM, "--by", "B", "--yes").out.count("as it was confirmed") == 1
    assert cell_file.read_bytes() == signed
    assert "verified by A on 2026-11-28" in run("models", "check", "cell.toml").out
    cell_file.write_bytes(signed.replace(b"z_mm = 150.0", b"z_mm = 151.0", 1))
    done = run("models", "check", "cell.toml")
    assert "NOT VERIFIED" in done.out
    assert (
        "cell.toml:41: warning: clearance.z_mm is 151.0; 150.0 was confirmed by A on 2026-11-28" in done.err
    )
    done = run(*CONFIRM, "--by", "B", "--yes", "--date", "2026-11-29")
    assert done.out.strip() == "cell.toml: confirmed and signed: clearance"
    assert "by B on 2026-11-29 (clearance)" in run("models", "check", "cell.toml").out


@AT_TERMINAL
def test_a_section_that_is_gone_is_asked_for(run, cell_file):
    run(*CONFIRM, "--by", "A", "--yes", "--date", "2026-11-28")
    cell_file.write_text(cell_file.read_text().replace("[table]\nz_mm = -60.0\n", "", 1))
    output, _ = at_terminal(cell_file, ["B", "n"])
    assert "! table.z_mm is gone; -60.0 was confirmed by A on 2026-11-28" in output
    assert not load_cell(cell_file).is_confirmed
    assert "confirmed and signed: table" in at_terminal(cell_file, ["B", "y"])[0]
    assert load_cell(cell_file).is_confirmed


def test_a_cell_with_an_error_is_not_confirmed(run, cell_file):
    cell_file.write_text(cell_file.read_text().replace("mass_kg = 42.0", "mass_kg = 4e6"))
    run(*CONFIRM, "--by", "A", "--yes", code=2)
    assert "[verified]" not in cell_file.read_text()


def test_what_is_taken_over_is_not_covered(run, tmp_path):
    (tmp_path / "cell.toml").write_text('based_on = "demonstration"\n[clearance]\nz_mm = 120.0\n')
    assert "NOT COVERED" in run(*CONFIRM, "--by", "A", "--yes").out
    cell = load_cell(tmp_path / "cell.toml")
    assert (cell.unconfirmed, cell.is_confirmed) == ((), False)


@AT_TERMINAL
@pytest.mark.parametrize(
    ("shown", "is_this"), [("#KR120R2700_2 C4 FLR", True), ("#KR120R2500 PRO C4", False), ("", False)]
)
def test_a_person_is_asked_section_by_section(cell_file, shown, is_this):
    values = values_by_section(load_cell(cell_file))
    answers = ["N. N."]
    for section in values:
        asked = [shown] if section == "robot" else []
        answers += [*asked, *(["n" if section == "load" else "y"] if is_this or section != "robot" else [])]
    output, code = at_terminal(cell_file, answers)
    assert code == 0, output
    declined = {"load"} | (set() if is_this else {"robot"})
    assert set(load_cell(cell_file).verified.sections) == set(values) - declined
    assert {one.key for one in load_cell(cell_file).unconfirmed} == declined
    assert "frames.base = X 1450 Y 20 Z 700 A 0 B 0 C 0 mm, deg  (line 22)" in output
    assert "switches $OUT[11] on" in output
    assert "controller.rapid_m_s = 0.2 m/s  (default)" in output
    assert ("this is not 'KR120R2700_2'" in output) == ("2500" in shown)
    assert f"NOT CONFIRMED: {', '.join(sorted(declined))}" in output


def at_terminal(cell_file, answers):
    """Run the command with a person who types these lines; return what the terminal shows, and the code."""
    typed = "".join(f"{answer}\n" for answer in answers)
    code, shown, _ = on_a_terminal(cell_file.parent, "models", "confirm", cell_file, typed=typed)
    return shown, code

"""Findings as the command line shows and releases them."""

import json
from pathlib import Path

import pytest

from gcode2krl.prediction import Prediction

HEAD = ["G21 G90 G94 G17", "T1 M6", "G43 H1"]


@pytest.fixture
def translate(run):
    """Translate lines as part.nc, but for its forces."""

    def translate(lines, *options, code):
        Path("part.nc").write_text("\n".join([*lines, "M30", ""]))
        return run("part.nc", "-o", "part.src", "--no-forces", *options, code=code)

    return translate


def _cuts(count: int, before: str = "G0 Z5") -> list[str]:
    """Stretches of feed, separated by rapids."""
    return [line for k in range(count) for line in (before, f"G0 X{100 + k} Y0", "G1 Z-1 F500", "G1 Y10")]


def test_a_spindle_that_never_runs_is_one_line(translate):
    lines = translate([*HEAD, "G0 X100 Y0 Z5", *_cuts(60)], code=1).err.splitlines()
    errors = [line for line in lines if ": error:" in line]
    assert len(errors) == 1
    assert (
        ":7: error: feed move with the spindle off: no M3 comes before it (also in lines 11, 15, 19 and 56"
        " more)" in errors[0]
    )


def test_json_lists_every_finding(translate):
    done = translate([*HEAD, "G0 X100 Y0 Z5", *_cuts(60)], "--json", code=1)
    issues = json.loads(done.out)["issues"]
    assert sum(issue["code"] == "spindle-off" for issue in issues) == 60
    assert all(set(issue) == {"severity", "code", "line", "message", "remedy"} for issue in issues)


def test_what_follows_from_an_unread_line_is_counted(translate):
    """As in a program whose feed is a parameter: the first bad line is the news, not 45 missing feeds."""
    program = [*HEAD, "S8000 M3", "#1=-1", "G0 X100 Y0 Z5", "F[SQRT[#1]]", "G1 Z-1", "G1 X1 $"]
    lines = translate(program, code=2).err.splitlines()
    assert ":7: error: " in lines[0]
    assert "[expression-value]" in lines[0]
    assert not [line for line in lines if "[no-feed]" in line]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["M3"], "M3 without S in line 4"),
        (["S8000 M3", "M5"], "it was stopped by M5 in line 5"),
        (["S8000 M3", "T2 M6", "G43 H2"], "it was stopped by M6 in line 5"),
    ],
)
def test_what_left_the_spindle_off_is_named(translate, lines, said):
    done = translate([*HEAD, *lines, "G0 X100 Y0 Z5", "G1 Z-1 F500"], code=1)
    assert f"feed move with the spindle off: {said} [spindle-off]" in done.err


def test_an_axis_without_a_position_is_named_with_what_lost_it(translate):
    done = translate([*HEAD, "S8000 M3", "G0 X100 Y0", "G1 X110 F500"], code=2)
    assert "Z is given no absolute position in 6 lines" in done.err
    done = translate([*HEAD, "S8000 M3", "G0 X100 Y0 Z5", "G28 Z0", "G1 X110 F500"], code=1)
    assert "Z is unknown since the" in done.err


def test_a_terminal_is_told_how_to_learn_more(translate, monkeypatch):
    lines = [*HEAD, "G0 X100 Y0 Z5", "G1 Z-1 F500"]
    assert "explain" not in translate(lines, code=1).err
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert translate(lines, code=1).err.splitlines()[-1] == "`gcode2krl explain spindle-off` says more"
    assert "explain" not in translate(lines, "-q", code=1).err


def test_no_cause_fills_the_screen(translate):
    """Every kind of bad line 300 times over: at most eight lines of a kind, twenty in all, then counts."""
    kinds = ["G1 X[1+]", "G5.2 X1", "G1 X1 $", "G1 X1 X2", "A90", "G0 G1 X1", "G1 X1 X2", "G1 Q5", "M66 P1"]
    program = [kind for k in range(30) for kind in kinds for _ in range(k % 3 + 1)]
    lines = translate(program, code=2).err.splitlines()
    codes = [line.partition(" [")[2].partition("]")[0] for line in lines if ": error:" in line]
    assert len(lines) <= 22
    assert len(codes) > 5
    assert max(map(codes.count, codes)) <= 8


PART = (
    "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X0 Y0\nG0 Z2\nG1 Z-2 F600\n"
    "X60\nG0 X0 Y30\nG0 Z30\nM5\nM30\n"
)
CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[-20, -20, -10], [80, 50, 0]]\nresolution_mm = 0.5\n'
CELL += "[material]\nrelative_band = 0.1\n"


def test_a_rapid_through_stated_stock_refuses_a_compensated_program_too(run, tmp_path):
    (tmp_path / "part.nc").write_text(PART)
    (tmp_path / "cell.toml").write_text(CELL)
    for more in ((), ("--compensate", "offline")):
        done = run(
            "part.nc", "-o", "part.src", "--cell", "cell.toml", "--pilot", "none", "--json", *more, code=1
        )
        found = [(i["severity"], i["code"], i["line"]) for i in json.loads(done.out)["issues"]]
        assert ("error", "rapid-in-stock", 9) in found
        assert not (tmp_path / "part.src").exists()


SLOT = "G21 G90 G17\nT1 M6\nG0 G43 H1 X-20 Y0 Z50\nG0 Z5\nG1 Z-1 F600\nG1 X100 F1500\nG0 Z50\nM30\n"
"""The spindle never turns."""


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "slot.nc"
    path.write_text(SLOT, encoding="ascii")
    return path


def severities(done):
    issues = json.loads(done.out)["issues"]
    return {issue["severity"] for issue in issues if issue["code"] == "spindle-off"}


def predict(run, part, *options):
    return run("predict", part, "-o", "out", "--no-forces", "--json", *options)


def test_a_finding_is_a_warning_where_it_is_allowed(run, part, tmp_path):
    assert severities(predict(run, part)) == {"error"}
    done = predict(run, part, "--allow", "spindle-off")
    assert done.code == 0, done.err
    assert severities(done) == {"warning"}
    of_prediction = {issue.severity for issue in Prediction.load(tmp_path / "out").issues}
    assert "error" in of_prediction  # whoever writes a program from it has to release it there
    assert severities(run("report", "out", "--json")) == {"warning"}


@pytest.mark.parametrize("word", ["spindle-of", "spindle-off:99", "spindle-off:x"])
def test_a_release_that_means_nothing_is_refused(run, part, word):
    done = predict(run, part, "--allow", word)
    assert done.code == 2
    assert [issue["code"] for issue in json.loads(done.out)["issues"]] == ["allow"]


def test_a_release_of_a_folder_counts_where_its_finding_is(run, part, tmp_path):
    (tmp_path / "gcode2krl.toml").write_text('allow = ["spindle-off", "g43-missing"]\n', encoding="utf-8")
    assert severities(predict(run, part)) == {"warning"}

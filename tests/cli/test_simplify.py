"""``--simplify`` as a user meets it."""

import json
import math

import pytest

from gcode2krl import Prediction, read_gcode, verify_krl, write_krl
from tests.conftest import ROOT

RASTER = ROOT / "examples" / "raster_finish.nc"
WAVE = "".join(f"X{x / 4:.3f} Y{3 * math.sin(x / 40):.3f}\n" for x in range(1, 321))
PART = (
    "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X-20 Y0\nG0 Z5\nG1 Z-2 F600\nX0 F1500\n"
    f"{WAVE}G0 Z30\nM5\nM30\n"
)
CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[-20, -20, -10], [100, 30, 0]]\nresolution_mm = 0.5\n'
CELL += "[material]\nrelative_band = 0.1\n"


@pytest.fixture
def part(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    path = tmp_path / "part.nc"
    path.write_text(PART)
    return path


def result_of(done):
    assert done.code == 0, done.err
    return json.loads(done.out)


def test_a_raster_of_short_moves_takes_less_than_half_the_time(run):
    whole = result_of(run(RASTER, "-o", "whole.src", "--no-forces", "--json"))
    result = result_of(run(RASTER, "-o", "out.src", "--no-forces", "--simplify", "0.01", "--json"))
    assert result["time_s"] < 0.5 * whole["time_s"]
    assert result["options"]["simplify_mm"] == 0.01
    assert result["moves"] == whole["moves"]
    original = result["verify"]["original"]
    assert 7000 < original["left_out"] < original["moves"]
    assert 0.0 < original["max_deviation_mm"] <= original["limit_mm"] == 0.011
    (note,) = [issue for issue in result["issues"] if issue["code"] == "simplified"]
    assert "s became 191" in note["message"]
    assert result["time_s"] == pytest.approx(191.3, abs=0.1)
    remedies = {issue["code"]: issue["remedy"] for issue in whole["issues"]}
    assert remedies["short-moves"].startswith("--simplify 0.01")


def test_it_is_verified_with_its_tolerance_only(run):
    assert run(RASTER, "-o", "out.src", "--no-forces", "--simplify", "0.01").code == 0
    done = run("verify", "out.src", RASTER, "--simplify", "0.01", code=0)
    assert "corners left out, at most 0.0100 mm off (0.0110 allowed)" in done.out
    for options in ((), ("--simplify", "0.02")):
        assert "-> --simplify 0.01" in run("verify", "out.src", RASTER, *options, code=2).err


def test_verify_sees_a_corner_that_was_taken_out_by_hand(run, part, tmp_path):
    assert run(part, "-o", "out.src", "--no-forces", "--simplify", "0.01").code == 0
    program = tmp_path / "out.src"
    lines = program.read_text().splitlines(keepends=True)
    lin = [k for k, line in enumerate(lines) if line.startswith("LIN")]
    del lines[lin[len(lin) // 2]]
    program.write_text("".join(lines))
    assert run("verify", "out.src", part, "--simplify", "0.01").code == 1


def test_the_header_says_it(run, part, tmp_path):
    assert run(part, "-o", "out.src", "--no-forces", "--simplify", "0.02").code == 0
    text = (tmp_path / "out.src").read_text()
    assert "; simplified: within 0.02 mm of every corner of the G-code" in text
    assert "simplify=0.02" in text
    assert run(part, "-o", "whole.src", "--no-forces").code == 0
    assert "simplified" not in (tmp_path / "whole.src").read_text()


@pytest.mark.parametrize("value", ["0", "-1", "2", "nan"])
@pytest.mark.parametrize("command", ["translate", "predict"])
def test_a_tolerance_out_of_range_is_one_line(run, part, command, value):
    done = run(
        command, part, "-o", "out.src" if command == "translate" else "out", "--simplify", value, code=2
    )
    assert "allowed 0.001 to 1" in done.err


def test_with_compensation(run, part):
    options = ("--cell", "cell.toml", "--compensate", "offline", "--simplify", "0.01")
    result = result_of(run(part, "-o", "out.src", *options, "--json"))
    original = result["verify"]["original"]
    assert original["left_out"] > 200
    assert original["limit_mm"] > 0.05  # the correction
    run("verify", "out.src", part, *options, code=0)


def test_with_a_restart(run, part):
    options = ("--cell", "cell.toml", "--from-line", "200", "--simplify", "0.01")
    result = result_of(run(part, "-o", "out.src", *options, "--json"))
    assert result["restart"]["line"] == 200
    assert result["verify"]["original"]["left_out"] > 50
    assert run("verify", "out.src", part, *options).code == 0


def test_with_rsi_and_a_page(run, part, tmp_path):
    result = result_of(
        run(part, "-o", "out.src", "--online", "OUT", "--simplify", "0.01", "--report", "out.html", "--json")
    )
    assert result["verify"]["original"]["left_out"] > 200
    assert (tmp_path / "out.html").stat().st_size > 10_000
    assert run("verify", "out.src", part, "--simplify", "0.01").code == 0


def test_standard_output_carries_it(run, part):
    done = run(part, "-o", "-", "--name", "PART", "--simplify", "0.01", code=0)
    assert "simplified: within 0.01 mm" in done.out


def test_a_saved_prediction_remembers_it(run, part, tmp_path):
    result = result_of(run("predict", part, "-o", "saved", "--simplify", "0.01", "--json"))
    assert result["time_s"] > 0
    prediction = Prediction.load(tmp_path / "saved")
    assert prediction.inputs["simplify_mm"] == 0.01
    program = write_krl(prediction, tmp_path / "later.src")
    assert program.report.original.left_out > 200
    assert run("verify", "later.src", part, "--simplify", "0.01").code == 0
    toolpath = read_gcode(part, prediction.cell)
    assert verify_krl(tmp_path / "later.src", toolpath, prediction.cell, prediction=prediction).ok


def test_a_page_of_a_refused_program_is_simplified_too(run, part, tmp_path):
    part.write_text(PART.replace("M5\n", "G0 Z-5\nX0\nM5\n"))
    run(part, "--cell", "cell.toml", "-o", "out.src", "--simplify", "0.01", "--report", "out.html", code=1)
    assert (tmp_path / "out.html").exists()

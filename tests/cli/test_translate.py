"""The command line as a user meets it: results, bad input, exit codes, what is left on the disk."""

import json
import subprocess
import sys

import pytest

from tests.conftest import EXAMPLES, ROOT

CLEAN = "G21 G90 G17\nT1 M6\nG0 G43 H1 Z50\nS12000 M3\nX0 Y0\nG1 Z-2 F600\nX50 F1500\nG0 Z50\nM5\nM30\n"


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(CLEAN, encoding="ascii")
    return path


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_translated_verified_and_verifies_again(run, tmp_path, example):
    result = json.loads(run(example, "-o", "out.src", "--json", code=0).out)
    assert [file.rsplit(".", 1)[1] for file in result["files"]] == ["src", "dat", "csv"]
    assert result["verify"]["max_deviation_mm"] <= 0.002
    assert result["verify"]["max_rotation_deg"] <= 0.001
    assert result["verify"]["max_speed_difference_mm_min"] <= 0.1
    beyond_notes = {issue["code"] for issue in result["issues"] if issue["severity"] != "note"}
    assert beyond_notes <= ({"short-moves"} if example.stem == "raster_finish" else set())  # 72 % of its time
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.dat", "out.pilot.csv", "out.src"]
    assert json.loads(run("verify", "out.src", example, "--json", code=0).out)["verify"]["ok"]


def test_json_has_every_key_of_the_contract(run, part):
    result = json.loads(run(part, "-o", "part.src", "--json").out)
    assert set(result) == {
        "schema",
        "command",
        "version",
        "input",
        "cell",
        "options",
        "exit_code",
        "counts",
        "sha256",
        "files",
        "moves",
        "time_s",
        "path_mm",
        "max_force_N",
        "max_deflection_mm",
        "corner_error_mm",
        "quantities",
        "verify",
        "pilot",
        "issues",
    }
    assert result["moves"] == 5
    assert result["path_mm"] == pytest.approx(52 + 50 + 52, abs=0.1)  # corners cut a little of it
    assert 52 / 10 + 50 / 25 + 52 / 200 < result["time_s"] < 9
    assert result["max_force_N"] > 100
    assert result["max_deflection_mm"] > 0.1
    assert result["pilot"]["knots"] > 2


def test_the_output_lies_beside_the_input_by_default(run, part, tmp_path):
    assert run(part).code == 0
    assert (tmp_path / "part.src").exists()


def test_the_summary_names_what_is_not_known(run, part):
    out = run(part).out
    assert "PART: 5 moves" in out
    assert "not known" in out


def test_standard_output_carries_only_the_program(run, part, tmp_path):
    done = run(part, "-o", "-", "--name", "MINE", code=0)
    assert done.out.startswith("&ACCESS RVP")
    assert "DEF MINE( )" in done.out
    assert "EXT BAS" in done.out
    assert done.out.rstrip().endswith("END")
    assert [path.name for path in tmp_path.iterdir()] == ["part.nc"]


def test_standard_input_and_output_through_a_pipe(tmp_path):
    command = [sys.executable, "-m", "gcode2krl", "-", "-o", "-"]
    done = subprocess.run(command, input=CLEAN.encode(), capture_output=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"&ACCESS RVP\r\n")
    assert b"\r\r" not in done.stdout


def test_two_claims_to_standard_output_are_refused(run, part):
    assert run(part, "-o", "-", "--json").code == 2


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (b"", 2, ("part.nc", "empty")),
        (b" \r\n\r\n", 2, ("empty",)),
        (b"\x00\x01\x02G1", 2, ("not a text file",)),
        (b"\x1f\x8b\x08\x00rest", 2, ("gzip", "cut off")),
        (b"G21\n(only a comment)\nM30\n", 2, ("no move",)),
        (b"G21\nG1 X" + b"1" * 9000, 2, (":2:", "longer than")),
        (b"G21\nG0 X0 Y0 Z9\nG123 X1\nM30\n", 2, (":3:", "G123")),
        (b"G21\nS900 M3\nG0 X0 Y0 Z9\nG1 X1\nM30\n", 2, (":4:", "without a feed")),
        (b"G21\nS900 M3\nG0 X0 Y0 Z9\nG1 X9000 F900\nM30\n", 1, (":4:", "out of reach")),
        (b"G21\nG0 X0 Y0 Z9\nM3 S900\nG2 X5 F100\nM30\n", 2, (":4:", "without I, J, K or R")),
        ("G21\nG0 X0 Y0 Z9 ß\nM30\n".encode("latin-1"), 2, (":2:", "U+00DF")),
        (b"G21\nG0 X1.2.3\nM30\n", 2, (":2:",)),
        (b"G21\nG0 X99999999999999999999\nM30\n", 2, (":2:", "too many digits")),
    ],
)
def test_bad_input_gets_one_clear_line_and_nothing_is_written(run, part, tmp_path, content, code, words):
    part.write_bytes(content)
    done = run(part, "-o", "out.src", code=code)
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["part.nc"]


def test_equal_findings_are_shown_once_with_their_lines_and_the_count(run, part):
    part.write_text("G21\n" + "G77 X1\n" * 50, encoding="ascii")
    done = run(part)
    assert done.err.count("G77 is not a G-code") == 1
    assert "(also in lines 3, 4, 5 and 46 more)" in done.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "nowhere/out.src"], "does not exist"),
        (["-o", "out.txt"], ".src"),
        (["--cell", "nowhere.toml"], "cannot read"),
        (["--tolerance", "-1"], "tolerance"),
        (["--tolerance", "much"], "not a valid float"),
        (["--chord-tolerance", "0"], "chord tolerance"),
        (["--name", "9X"], "digit"),
        (["--name", "LIN"], "keyword"),
        (["--allow", "nonsense"], "CODE:LINE"),
        (["--allow", "spindle-off:3"], "no such finding"),
        (["--unknown"], "No such option"),
    ],
)
def test_wrong_options_are_one_line_and_exit_code_2(run, part, arguments, words):
    done = run(part, *arguments, code=2)
    assert words in done.err
    assert len(done.err.strip().splitlines()) == 1


def test_a_missing_part(run):
    assert "nowhere.nc" in run("nowhere.nc", "-o", "out.src", code=2).err


def test_output_that_is_the_input(run, tmp_path):
    path = tmp_path / "part.src"
    path.write_text(CLEAN, encoding="ascii")
    run(path, "-o", path, code=2)
    assert path.read_text(encoding="ascii") == CLEAN


def test_an_unwritable_folder(run, part, tmp_path, monkeypatch):
    import os

    def full(*arguments, **named):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert "No space left" in run(part, "-o", "out.src", code=2).err
    assert [path.name for path in tmp_path.iterdir()] == ["part.nc"]


def test_strict_refuses_warnings(run, part):
    part.write_text(CLEAN.replace("M30\n", ""), encoding="ascii")
    assert run(part).code == 0
    assert "no-program-end" in run(part, "--strict", "-o", "strict.src", code=1).err


def test_a_released_finding_is_listed_in_the_head(run, part, tmp_path):
    part.write_text(CLEAN.replace("M5\n", "M88\nM5\n"), encoding="ascii")
    assert run(part).code == 1
    run(part, "--allow", "m-code-unmapped:9", "-o", "out.src", code=0)
    text = (tmp_path / "out.src").read_text(encoding="ascii")
    assert "released by hand: m-code-unmapped:9" in text
    assert "M88 HAS NO KRL" in text


def test_some_findings_are_never_released(run, part):
    part.write_text(CLEAN.replace("X50", "X9000"), encoding="ascii")
    assert "cannot be released" in run(part, "--allow", "out-of-reach:7", code=2).err


def test_windows_files(run, tmp_path):
    path = tmp_path / "Teil 1.nc"
    path.write_bytes(b"\xef\xbb\xbf" + CLEAN.replace("\n", "\r\n").encode())
    run(path, "-o", "teil.src", code=0)


def test_help_is_quick_because_it_imports_nothing_heavy():
    program = (
        "import sys; sys.argv = ['gcode2krl', '--help']\n"
        "from gcode2krl.cli.main import _run\n_run(['--help'])\n"
        "print([name for name in ('numba', 'scipy', 'rich', 'jinja2') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")


@pytest.mark.parametrize("extra", [[], ["--json"]])
def test_models_commands(run, extra):
    assert "KR 300 R2500 ultra" in run("models", "list", *extra).out
    assert "KR 300 R2500 ultra" in run("models", "check", *extra).out


def test_models_show_and_schema(run):
    assert "sure" in run("models", "show", "kr300r2500 ultra").out
    assert "properties" in json.loads(run("models", "schema").out)
    assert run("models", "show", "nothing").code == 2


def test_models_check_names_the_wrong_key(run, tmp_path):
    (tmp_path / "cell.toml").write_text("[home]\nq_deg = 5\n", encoding="ascii")
    assert "home.q_deg" in run("models", "check", "cell.toml", code=2).err


def test_the_cell_files_of_the_documents_are_valid(tmp_path):
    import re

    from gcode2krl import load_cell

    blocks = re.findall(
        r"```toml\n(.*?)```", (ROOT / "docs" / "cell.md").read_text(encoding="utf-8"), flags=re.S
    )
    assert len(blocks) >= 5
    for block in blocks:
        path = tmp_path / "cell.toml"
        path.write_text(block, encoding="utf-8")
        load_cell(path)


def test_examples_are_what_their_script_makes(tmp_path):
    script = ROOT / "examples" / "make_examples.py"
    subprocess.run([sys.executable, script, "--out", tmp_path], check=True, capture_output=True)
    for example in EXAMPLES:
        assert (tmp_path / example.name).read_bytes() == example.read_bytes()

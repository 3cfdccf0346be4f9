"""``translate --online NAME`` as a user meets it."""

import json
import xml.etree.ElementTree as ET

import pytest

from tests.cli.test_translate import CLEAN

CELL = 'based_on = "demonstration"\n[online]\nmost_mm = 1.5\n[online.link]\n'
CELL += 'address = "192.168.7.3"\nport = 50001\n'
FILES = ["ImFree.rsi.xml", "ImFree_ETH.xml", "out.dat", "out.pilot.csv", "out.src"]


@pytest.fixture
def translate(run, tmp_path):
    (tmp_path / "part.nc").write_text(CLEAN, encoding="ascii")
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    return lambda *options: run("part.nc", "-o", "out.src", "--cell", "cell.toml", *options)


def made(tmp_path):
    return sorted(path.name for path in tmp_path.iterdir() if path.name not in ("part.nc", "cell.toml"))


def test_program_and_files_are_written_listed_and_verified(translate, run, tmp_path):
    done = translate("--online", "ImFree", "--json")
    assert done.code == 0, done.err
    result = json.loads(done.out)
    assert made(tmp_path) == sorted(FILES)
    assert sorted(file for file in result["files"]) == sorted(FILES)
    assert not any(issue["code"].startswith(("online", "rsi")) for issue in result["issues"])
    again = run("verify", "out.src", "part.nc", "--cell", "cell.toml", "--json", code=0)
    assert json.loads(again.out)["verify"]["ok"]


def test_the_files_say_what_the_cell_says(translate, tmp_path):
    assert translate("--online", "ImFree").code == 0
    config = ET.fromstring((tmp_path / "ImFree_ETH.xml").read_bytes())
    assert config.findtext("CONFIG/IP_NUMBER") == "192.168.7.3"
    assert config.findtext("CONFIG/PORT") == "50001"
    assert {e.get("TAG") for e in config.iter("ELEMENT")} >= {"SenPInt1", "SenPInt2", "RKorr.X", "Ready"}
    flow = ET.fromstring((tmp_path / "ImFree.rsi.xml").read_bytes())
    limits = {p.get("Name"): p.get("ParamValue") for p in flow.iter("Parameter")}
    assert (limits["LowerLimX"], limits["UpperLimZ"], limits["MaxTrans"]) == ("-1.5", "1.5", "1.8")
    assert limits["ConfigFile"] == "ImFree_ETH.xml"
    header = (tmp_path / "out.src").read_text("ascii")
    assert "online=ImFree" in header


def test_a_person_is_told_what_to_do_with_them(translate):
    out = translate("--online", "ImFree").out
    assert "SensorInterface" in out
    assert "online serve --tool 1 --pilot out.pilot.csv" in out


def test_verify_notices_a_changed_cell_and_a_changed_program(translate, run, tmp_path):
    assert translate("--online", "ImFree").code == 0
    verify = ("verify", "out.src", "part.nc", "--cell", "cell.toml", "-q")
    text = (tmp_path / "out.src").read_bytes()
    (tmp_path / "out.src").write_bytes(text.replace(b"#ABSOLUTE", b"#RELATIVE"))
    assert "[rsi-mode]" in run(*verify, code=1).err
    (tmp_path / "out.src").write_bytes(text)
    assert run(*verify).code == 0
    (tmp_path / "cell.toml").write_text(CELL.replace("1.5", "1.0"), encoding="utf-8")
    assert "[rsi-file]" in run(*verify, code=1).err


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--online", ""], 2, "name of the RSI files"),
        (["--online", "a b"], 2, "name of the RSI files"),
        (["--online", "../x"], 2, "name of the RSI files"),
        (["--online", "X" * 17], 2, "name of the RSI files"),
        (["--online", "aux"], 2, "name of the RSI files"),
        (["--online"], 2, "requires an argument"),
        (["--online", "A", "--compensate", "offline"], 1, "compensation-twice"),
        (["--online", "A", "--both"], 2, "no two compensations"),
        (["--both", "--compensate", "offline"], 2, "no two compensations"),
    ],
)
def test_wrong_options_are_one_line_and_nothing_is_written(translate, tmp_path, options, code, words):
    done = translate(*options)
    assert done.code == code
    assert words in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert made(tmp_path) == []


def test_not_on_standard_output(run, tmp_path):
    (tmp_path / "part.nc").write_text(CLEAN, encoding="ascii")
    done = run("part.nc", "-o", "-", "--online", "A", code=2)
    assert "standard output" in done.err
    assert done.out == ""


def test_both_compensations_need_a_word(translate, run, tmp_path):
    """The band must be narrow enough for offline compensation."""
    sure = "[material]\nrelative_band = 0.1\n[stock]\nbox_mm = [[-20, -20, -9], [60, 20, 0]]\n"
    (tmp_path / "cell.toml").write_text(CELL + sure, encoding="utf-8")
    options = ("--online", "A", "--compensate", "offline", "--both")
    done = translate(*options)
    assert done.code == 0, done.err
    assert "compensate=offline online=A both=True" in (tmp_path / "out.src").read_text("ascii")
    verify = ("verify", "out.src", "part.nc", "--cell", "cell.toml", "-q", "--compensate", "offline")
    assert run(*verify).code == 0


def test_a_part_with_two_tools_is_refused_with_its_line(run, tmp_path):
    text = CLEAN.replace("M5\n", "T2 M6\nG0 G43 H2 Z50\nG0 X0 Y0\nG1 Z-2 F600\nG0 Z50\nM5\n")
    (tmp_path / "part.nc").write_text(text, encoding="ascii")
    done = run("part.nc", "--online", "A", "--json", code=1)
    errors = [issue for issue in json.loads(done.out)["issues"] if issue["severity"] == "error"]
    assert ("online-tool", 9) in [(issue["code"], issue["line"]) for issue in errors]
    assert made(tmp_path) == []

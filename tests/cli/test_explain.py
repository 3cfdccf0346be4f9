"""`gcode2krl explain`, and what the first word of a command line may be."""

import json
from pathlib import Path

import pytest

from gcode2krl.cli import main as entry
from gcode2krl.codes import all_codes


def _run(*words: str) -> int:
    with pytest.raises(SystemExit) as left:
        entry.main(list(words))
    return int(left.value.code or 0)


@pytest.mark.parametrize("word", ["spindle-off", "Spindle-Off", "spindle-off:12", "[spindle-off]"])
def test_explains_a_code_as_it_is_printed(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("explain", word) == 0
    text = capsys.readouterr().out
    first, *rest = text.splitlines()
    assert first == "spindle-off: error, warning"
    assert [line.split()[0] for line in rest if line.startswith("  ") and line[2] != " "] == [
        "why",
        "example",
        "remedy",
        "allow",
    ]
    assert "M6 stops the spindle" in text
    assert max(map(len, rest)) <= 100


def test_lists_all_codes_with_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("explain") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(all_codes())
    assert max(map(len, lines)) <= 110


def test_an_unknown_code_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("explain", "spindel-off") == 2
    assert "did you mean 'spindle-off'?" in capsys.readouterr().err
    assert _run("explain", "qqqq") == 2
    assert "lists all" in capsys.readouterr().err


def test_json_holds_every_column(capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("explain", "no-feed", "--json") == 0
    (record,) = json.loads(capsys.readouterr().out)["codes"]
    assert record["code"] == "no-feed"
    assert set(record) == {"code", "severity", "why", "example", "remedy", "allow", "follows"}
    assert _run("explain", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["codes"]) == len(all_codes())
    assert _run("explain", "nofeed", "--json") == 2
    assert json.loads(capsys.readouterr().out)["issues"][0]["code"] == "code-unknown"


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("predct", "no command 'predct': did you mean 'predict'?"),
        ("Verify", "no command 'Verify': did you mean 'verify'?"),
        ("diganose", "did you mean 'diagnose'?"),
        ("qqqq", "no such file 'qqqq'"),
        ("q" * 300, "no such file"),
    ],
)
def test_a_mistyped_command_is_one_line(
    word: str, said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _run(word, "x.nc") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]


def test_a_part_may_be_called_much_like_a_command(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("predct").write_text("G1 X5\nM30\n")
    assert _run("predct", "-o", "part.src") == 2
    assert (
        "predct:1: error: feed move without a feed: no F above 0 since the start" in capsys.readouterr().err
    )
    assert _run("predct.nc", "-o", "part.src") == 2
    assert "predct.nc: error: cannot read" in capsys.readouterr().err
    assert _run("-o", "part.src", "predct") == 2
    assert "[no-feed]" in capsys.readouterr().err

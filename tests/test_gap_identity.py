"""The comparison of two trees: what it stores, what it calls a difference, and one case through all of it."""

import json
import shutil
import sys
from importlib import import_module
from pathlib import Path

import polars as pl
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
identity = import_module("gap_identity")
cases = import_module("gap_identity_cases")
comparison = import_module("gap_identity_compare")
programs = import_module("gap_identity_programs")
running = import_module("gap_identity_run")
timing = import_module("gap_identity_time")

ROOT = Path(__file__).resolve().parents[1]
RESULT = {
    "verdict": "explained",
    "links": [{"link": "path", "noise": 1.0}, {"link": "servo", "noise": 2.0}],
    "causes": [{"effect": "backlash", "probability": 0.9, "where": "there"}],
    "notes": [],
}


def outputs(folder: Path, **texts: str) -> Path:
    folder.mkdir()
    for name, text in texts.items():
        (folder / f"{name}.json").write_text(text)
    return folder


def compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], result: object, before: object = RESULT
) -> str:
    a, b = (json.dumps(each, indent=2) for each in (before, result))
    code = identity.main(
        ["compare", str(outputs(tmp_path / "a", one=a)), str(outputs(tmp_path / "b", one=b))]
    )
    assert code == int(a != b)
    return capsys.readouterr().out


def changed(**values: object) -> dict[str, object]:
    return json.loads(json.dumps(RESULT)) | values


def test_the_same_bytes_are_identical(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compared(tmp_path, capsys, RESULT) == "1 of 1 files are identical\n"


def test_the_last_bit_of_a_number_is_a_difference(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    last_bit = [{"link": "path", "noise": 1.0}, {"link": "servo", "noise": 2.0000000000000004}]
    said = compared(tmp_path, capsys, changed(links=last_bit))
    assert "0 of 1 files are identical" in said
    assert "one.json: largest relative difference 2.2e-16 at links.noise\n" in said
    assert "0 files with another answer" in said


@pytest.mark.parametrize(
    ("result", "place"),
    [
        (changed(verdict="no_gap"), "verdict"),
        (changed(causes=[{"effect": "friction", "probability": 0.9, "where": "there"}]), "causes.effect"),
        (changed(links=[{"link": "gear", "noise": 1.0}, {"link": "servo", "noise": 2.0}]), "links.link"),
        (changed(notes=["a note"]), "notes"),
    ],
)
def test_words_are_another_answer(
    result: object, place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = compared(tmp_path, capsys, result)
    assert f"one.json: another answer: {place}\n" in said
    assert "1 files with another answer" in said


@pytest.mark.parametrize(
    ("result", "place"),
    [
        (changed(causes=[]), "causes"),
        (changed(causes=[{"effect": "backlash", "probability": None, "where": "there"}]), "probability"),
        (changed(more=1), "more"),
        ({key: value for key, value in RESULT.items() if key != "notes"}, "notes"),
    ],
)
def test_what_is_there_or_not_is_a_difference(
    result: object, place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert place in compared(tmp_path, capsys, result)


def test_another_order_alone_is_said_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = compared(tmp_path, capsys, dict(reversed(RESULT.items())))
    assert "one.json: only order or spelling" in said


def test_lines_of_a_program(tmp_path: Path) -> None:
    a, b = tmp_path / "a.src", tmp_path / "b.src"
    a.write_bytes(b"LIN {X 1.5}\nWAIT SEC 0\nEND\n")
    b.write_bytes(b"LIN {X 3.0}\nHALT\nEND\n")
    found = comparison.difference("a.src", a, b)
    assert (found.largest, found.largest_at, list(found.places)) == (0.5, "line 1", ["line 2"])
    b.write_bytes(a.read_bytes().replace(b"\n", b"\r\n"))
    assert comparison.difference("a.src", a, b).order_only
    b.write_bytes(b"\xff\xfe")
    assert list(comparison.difference("a.src", a, b).places) == ["bytes"]


def test_a_missing_file_and_a_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = outputs(tmp_path / "a", one="{}", two="{}"), outputs(tmp_path / "b", one="{}")
    (a / "one.toml").write_text("")
    assert identity.main(["compare", str(a), str(b)]) == 1
    assert f"two.json: only in {a}" in capsys.readouterr().out
    assert identity.main(["compare", str(a), str(b), "--part"]) == 1  # of case one a file is missing
    said = capsys.readouterr().out
    assert f"one.toml: only in {a}" in said
    assert "two" not in said
    (b / "one.toml").write_text("")
    assert identity.main(["compare", str(a), str(b), "--part"]) == 0
    assert identity.main(["compare", str(a), str(tmp_path / "none")]) == 2


def test_records_are_compared_and_no_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = outputs(tmp_path / "a", one="{}"), outputs(tmp_path / "b", one="{}")
    for out, cpu_s, peak_MB in ((a, 2.0, 100.0), (b, 3.0, 150.0)):
        record = {"cpu_s": cpu_s, "wall_s": cpu_s, "peak_MB": peak_MB}
        outputs(out / "records", one=json.dumps(record))
    assert identity.main(["compare", str(a), str(b)]) == 0
    said = capsys.readouterr().out
    assert "cpu_s: 2.0 and 3.0 s for 1 cases, ratio 1.500" in said
    assert "peak_MB: 100 and 150 MB at most, ratio 1.500" in said


def test_every_effect_and_slip_is_among_the_stored_cases() -> None:
    whole = cases.wanted(86)
    assert {each.effect for each in whole} >= {*cases.LIBRARY, *cases.SLIPS}
    kinds = [each.kind for each in whole]
    assert {kind: kinds.count(kind) for kind in ("null", "open", "pair", "deleted", "log", "blind")} == {
        "null": 5,
        "open": 3,
        "pair": 3,
        "deleted": 3,
        "log": 4,
        "blind": 3,
    }
    assert sum(each.holdout for each in whole) >= 10
    assert sum(each.apply for each in whole) >= 4
    assert len({each.kind for each in whole[::5]}) >= 5  # a part has some of each
    assert cases.wanted(90)[86:] == whole[:4]
    assert len(set(cases.wanted(12))) == 12


def test_scored_seeds_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in ("0", "29990", "30000"):
        assert identity.main(["make", str(tmp_path), "--seed", seed]) == 2
        assert "must stay between 1 and 29999" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_command_is_called_in_this_process() -> None:
    assert "no-runs" in running.called(["explain", "no-runs"])
    refused = running.called(["explain", "no-such-code"])
    assert "exit code 2" in refused
    assert "no-such-code" in refused


def test_columns_of_a_table(tmp_path: Path) -> None:
    table = pl.DataFrame(
        {"x_mm": [1.0, -3.0, float("nan")], "name": ["a", "b", None], "on": [True, False, True]}
    )
    table.write_parquet(tmp_path / "a.parquet")
    table.with_columns(pl.Series("x_mm", [1.0, -3.0, 0.0])).write_parquet(tmp_path / "b.parquet")
    a, b = (programs.columns(tmp_path / f"{name}.parquet") for name in "ab")
    assert (a["x_mm"]["sum"], a["x_mm"]["absolute_sum"], a["x_mm"]["rows"]) == (-2.0, 4.0, 3)
    assert [a[name] == b[name] for name in ("x_mm", "name", "on")] == [False, True, True]


def test_calls_have_names_of_their_own_and_every_effect() -> None:
    from gcode2krl.effects import library

    names = [call.name for call in programs.calls()]
    assert len(set(names)) == len(names)
    predicted = {name.removeprefix("effect-") for name in names if name.startswith("effect-")}
    assert predicted == set(library()) - {"other_program"}


def test_summary_of_a_comparison_in_time() -> None:
    took = [
        {"cpu_s": s, "wall_s": 2.0 * s, "peak_MB": m, "after_MB": 50.0}
        for s, m in ((4.0, 100.0), (5.0, 80.0))
    ]
    slower, same = timing.Pair("x", *took, True), timing.Pair("y", took[0], took[0], False)
    said = timing.summary([[slower], [same]])
    assert "processor time: A 8.0 s, B 9.0 s, B/A 1.125; of single cases the median is 1.125" in said
    assert "the range 1.000..1.250, the standard error of their mean 0.125" in said
    assert "peak memory, mean of 2 rounds: A 100 (100..100) MB, B 90 (80..100) MB, B/A 0.900" in said
    assert "most memory after a case, mean of 2 rounds: A 50 (50..50) MB" in said
    assert "1 of 2 outputs identical" in said


@pytest.mark.slow
def test_one_case_through_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, a, b = tmp_path / "cases", tmp_path / "a", tmp_path / "b"
    assert identity.main(["make", str(folder), "--cases", "1"]) == 0
    assert identity.main(["make", str(folder), "--cases", "1"]) == 0  # what is there stays
    assert not list(folder.rglob("*label*"))
    assert identity.main(["run", str(folder), str(a), "--only", "example"]) == 0
    shutil.copytree(a, b)
    assert json.loads((a / "example.json").read_text())["verdict"] == "explained"
    assert "backlash" in (a / "example-text.txt").read_text()
    capsys.readouterr()
    assert identity.main(["run", str(folder), str(b), "--only", "example"]) == 0
    assert "2 cases, 2 already there" in capsys.readouterr().err
    assert identity.main(["compare", str(a), str(b)]) == 0
    assert "2 of 2 files are identical\ncpu_s: " in capsys.readouterr().out
    words = ["time", str(ROOT), str(ROOT), str(folder), "--cases", "1", "--rounds", "1"]
    assert identity.main(words) == 0
    assert "1 of 1 outputs identical" in capsys.readouterr().out


@pytest.mark.slow
def test_effects_can_be_left_out_of_the_candidates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "cases"
    assert cases.store(folder, 1, 1) == 0
    job = next(job for job in running.stored_jobs(folder) if job["name"] == "example")
    monkeypatch.chdir(folder)
    *words, last = job["arguments"]
    without = job | {"arguments": [*words, "--holdout", last], "exclude": ["backlash"]}
    result = json.loads(running.diagnosed(without, "out"))
    assert "backlash" not in {cause["effect"] for cause in result["causes"]}
    assert [Path(run).name for run in result["runs"]] == ["run-1", "run-2", "run-3"]

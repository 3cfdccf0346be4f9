"""Broken and random files: a run, or one clear error that names the file; never another exception."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs import check_against, load_run
from tests.runs import maker
from tests.runs.test_krc_trace import data_set
from tests.runs.test_rsi_log import log

FILES = (
    "controller.csv",
    "controller.parquet",
    "tracker.csv",
    "force.parquet",
    "scan.csv",
    "scan.ply",
    "rsi.log",
    "rsi.csv",
    "a_KRCIpo.dat",
    "run.toml",
)
HEADS = (
    b"",
    b"PAR1",
    b"DIAEXTENDED\n",
    b"<Rob ",
    b"ply\n",
    b"t_s,x_mm,y_mm,z_mm\n",
    b"\xef\xbb\xbft_s,",
    b"IPOC,RIst_X\n",
)
WORDS = ("", "nan", "inf", "-1e308", "abc", "1,5", "1e999", '"', "\x00", "9" * 400, "é", "-0", "\t")
KEYS = (
    "cell",
    "started",
    "angles",
    "mode",
    "override_percent",
    "frames",
    "files",
    "files.scan",
    "clocks.force_s",
    "noise",
    "a.b",
)
VALUES = (
    "-1",
    "1e308",
    "nan",
    "true",
    '"text"',
    "[]",
    "{}",
    '"../../../etc"',
    '"."',
    "9" * 20,
    "1979-05-27",
    '"\\u0000"',
)
QUIET = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def load_or_refuse(folder):
    """Load a run; any failure must be an error of the project that names the file."""
    message = ""
    try:
        run = load_run(folder)
    except NotUnderstoodError as error:
        message = str(error)
    else:
        t = np.linspace(0.0, 10.0, 400)
        check_against(run, t, maker.path(t), np.radians(maker.joints_deg(maker.path(t))))
    assert message == "" or str(folder) in message


@QUIET
@given(name=st.sampled_from(FILES), head=st.sampled_from(HEADS), body=st.binary(max_size=600))
def test_random_bytes(tmp_path_factory, name, head, body):
    folder = maker.run_folder(tmp_path_factory.mktemp("fuzz") / "run")
    (folder / name).write_bytes(head + body)
    load_or_refuse(folder)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """Return good files by name."""
    place = tmp_path_factory.mktemp("good")
    few = slice(0, 60)
    files = {
        "controller.csv": maker.write(place, "a.csv", {k: v[few] for k, v in maker.controller().items()}),
        "tracker.parquet": maker.write(place, "b.parquet", {k: v[few] for k, v in maker.tracker().items()}),
        "scan.csv": maker.write(place, "c.csv", {f"{a}_mm": np.arange(60.0) for a in "xyz"}),
    }
    t = np.arange(60) * 0.004
    trace = data_set(place, "a_KRCIpo", 0.004, [(f"{a}_CmdIpo", "mm", t, 1.0, 0.0) for a in "XYZ"])
    files |= {"a_KRCIpo.dat": trace, "a_KRCIpo.r64": trace.with_suffix(".r64")}
    (place / "rsi.log").write_text("\n".join(log(count=30)[-1]), encoding="utf-8")
    files["rsi.log"] = place / "rsi.log"
    (place / "run.toml").write_text('angles = "absolute"\n[frames]\ntracker = "base"\n', encoding="utf-8")
    files["run.toml"] = place / "run.toml"
    return {name: file.read_bytes() for name, file in files.items()}


@QUIET
@given(key=st.sampled_from(KEYS), value=st.sampled_from(VALUES), above=st.booleans())
def test_odd_values_in_the_head(tmp_path_factory, key, value, above):
    folder = maker.run_folder(tmp_path_factory.mktemp("fuzz") / "run")
    lines = ['angles = "absolute"', "[frames]", 'tracker = "base"']
    lines.insert(0 if above else 3, f"{key} = {value}")
    (folder / "run.toml").write_text("\n".join(lines), encoding="utf-8")
    load_or_refuse(folder)


@QUIET
@given(data=st.data(), name=st.sampled_from(["controller.csv", "rsi.log", "a_KRCIpo.dat", "scan.csv"]))
def test_odd_words_in_the_cells(tmp_path_factory, good, data, name):
    words = re.split(r"([,\n\" ])", good[name].decode("utf-8"))
    for _ in range(data.draw(st.integers(1, 5))):
        words[data.draw(st.integers(0, len(words) - 1))] = data.draw(st.sampled_from(WORDS))
    folder = maker.run_folder(tmp_path_factory.mktemp("fuzz") / "run")
    if name.endswith(".dat"):
        (folder / "a_KRCIpo.r64").write_bytes(good["a_KRCIpo.r64"])
    (folder / name).write_bytes("".join(words).encode(data.draw(st.sampled_from(["utf-8", "utf-16"]))))
    load_or_refuse(folder)


@QUIET
@given(st.data())
def test_numbers_in_the_footer_of_a_table(tmp_path_factory, good, data):
    table = bytearray(good["tracker.parquet"])
    footer = len(table) - 8 - int.from_bytes(table[-8:-4], "little")
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(footer, len(table) - 5))
        table[at : at + 1] = data.draw(st.sampled_from([b"\xff", b"\x80", b"\x00", b"\x7f", b"\xfe"]))
    folder = maker.run_folder(tmp_path_factory.mktemp("fuzz") / "run")
    (folder / "tracker.parquet").write_bytes(bytes(table))
    load_or_refuse(folder)


@QUIET
@given(st.data())
def test_good_files_with_some_bytes_changed(tmp_path_factory, good, data):
    name = data.draw(st.sampled_from(sorted(good)))
    text = bytearray(good[name])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at : at + data.draw(st.integers(0, 12))] = data.draw(st.binary(max_size=12))
        text = text or bytearray(b"\n")
    folder = maker.run_folder(tmp_path_factory.mktemp("fuzz") / "run")
    if name.endswith((".dat", ".r64")):
        for other in ("a_KRCIpo.dat", "a_KRCIpo.r64"):
            (folder / other).write_bytes(good[other])
    (folder / name).write_bytes(bytes(text))
    load_or_refuse(folder)

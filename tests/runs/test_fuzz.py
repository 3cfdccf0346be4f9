"""Broken and random files: a run, or one clear error that names the file; never another exception."""

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

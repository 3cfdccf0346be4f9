"""Identification recovers the parameters of a trace; the traces come from brute force, not from the
planner."""

import io
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import set_targets
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gcode import read_stream
from gcode2krl.identify import controller as identify
from gcode2krl.identify.controller import identify_controller
from gcode2krl.identify.trial_program import CDIS_MM, TURNS, controller_test_program, corner_tolerance_mm
from gcode2krl.pipeline import controller_test_targets
from gcode2krl.runs import ControllerTrace
from tests.identify import made_up_controller as bench

Controller = bench.Controller

HEAD = "G21 G90 G17 G40 G49 G80 G94\nT1 M6\nS1000 M3\nG0 G43 H1 Z60\nG0 X100 Y0\nG61\nG4 P0.3\n"


def targets_of(text, cell):
    return set_targets(read_stream(io.BytesIO(text.encode()), "test.nc", cell), cell)


def trace_of(text, controller, seed=1, noise_mm=0.005, **more):
    rng = np.random.default_rng(seed)
    t, position = bench.simulate(bench.legs_of(text), controller, rng, noise_mm=noise_mm, **more)
    return ControllerTrace(t, position, np.arange(len(t)) + 2, 0, "trace.csv")


def write_csv(trace, file):
    rows = np.column_stack([trace.time_s, trace.position_mm])
    np.savetxt(file, rows, fmt="%.6f", delimiter=",", header="t_s,x_cmd_mm,y_cmd_mm,z_cmd_mm", comments="")
    return file


@pytest.fixture(scope="module")
def text(cell):
    return controller_test_program(cell)


@pytest.fixture(scope="module")
def targets(text, cell):
    return targets_of(text, cell)


# --- lines that turn the tool ---------------------------------------------------------------------------


def turning_trace(text, cell, controller, vel_ori, acc_ori, seed=3):
    rng = np.random.default_rng(seed)
    start = np.array([100.0, 0.0, 60.0])
    legs = bench.legs_of(text)
    for length, angle in TURNS:
        end = start + np.array([length, 0.0, 0.0])
        for way in ((start, end), (end, start)):
            legs.append(bench.turning_leg(*way, angle, vel_ori, acc_ori, 200.0, 0.3))
    t, position = bench.simulate(legs, controller, rng, noise_mm=0.005)
    return ControllerTrace(t, position, np.arange(len(t)) + 2, 0, "trace.csv")


@pytest.mark.slow
def test_turning_lines_give_the_limits_of_orientation(text, cell):
    slow = {"vel_ori_deg_s": 30.0, "acc_ori_deg_s2": 150.0, "law": "trapezoid"}
    own = cell.model_copy(update={"controller": cell.controller.model_copy(update=slow)})
    trace = turning_trace(text, cell, Controller(law="trapezoid"), vel_ori=24.0, acc_ori=110.0)
    found = identify_controller(trace, controller_test_targets(own), own)
    assert found.vel_ori_deg_s.value == pytest.approx(24.0, rel=1e-3)
    assert found.acc_ori_deg_s2.value == pytest.approx(110.0, rel=5e-3)
    assert found.k_s.contains(0.168)
    assert found.turning_rms_mm < 0.01


@pytest.mark.slow
def test_turning_lines_that_never_reach_their_speed_leave_it_open(text, cell):
    trace = turning_trace(text, cell, Controller(), vel_ori=200.0, acc_ori=100.0)
    found = identify_controller(trace, controller_test_targets(cell), cell)
    assert found.vel_ori_deg_s is None
    assert found.acc_ori_deg_s2.value == pytest.approx(100.0, rel=0.01)
    assert any("$VEL.ORI is not determined" in issue.message for issue in found.issues)


@pytest.mark.slow
def test_the_krl_form_has_the_turning_lines_and_its_trace_is_read(run, text, cell, tmp_path):
    run("make-test", "controller", "-o", "test.src", "--json", code=0)
    source = Path("test.src").read_text("ascii")
    assert all(f"B -{angle:.4f}" in source for _, angle in TURNS)
    write_csv(turning_trace(text, cell, Controller(), 200.0, 100.0), Path("trace.csv"))
    record = json.loads(run("identify", "controller", "trace.csv", "--json").out)
    assert record["acc_ori_deg_s2"] == pytest.approx(100.0, rel=0.01)


# --- the program ----------------------------------------------------------------------------------------


def test_program_translates_without_findings(run, tmp_path):
    run("make-test", "controller", "-o", "test.nc", code=0)
    outcome = run("test.nc", "-o", "test.src", "--json", "--strict", code=0)
    codes = [issue["code"] for issue in json.loads(outcome.out)["issues"]]
    assert codes == ["cell-not-verified", "exact-stops", "corner-undecided", "stock-guessed"]  # on purpose
    assert "$APO.CDIS=5.000" in (tmp_path / "test.src").read_text()


def test_program_holds_what_it_promises(targets):
    blended = targets.cdis_mm > 0
    assert set(targets.cdis_mm[blended].tolist()) == {CDIS_MM}
    programmed = targets.move >= 0
    position = targets.position_mm[programmed]
    assert position.min(axis=0)[2] >= 20
    assert position.max(axis=0)[2] <= 100
    assert np.abs(position[:, :2]).max() <= 400
    way = np.diff(position, axis=0)
    length = np.linalg.norm(way, axis=1)
    pairs = set(zip(np.round(length).tolist(), targets.speed_mm_s[programmed][1:].tolist(), strict=True))
    assert {(x, v) for x in (1, 2, 5, 10, 20, 50) for v in (25, 100, 200)} <= pairs
    corner = np.flatnonzero(blended[programmed])
    cosine = -np.einsum("ij,ij->i", way[corner - 1], way[corner]) / (length[corner - 1] * length[corner])
    assert sorted(set(np.round(np.degrees(np.arccos(cosine))))) == [30, 60, 90, 120, 150, 170]


def test_gcode_says_that_it_lacks_the_turning_lines(text):
    assert "LINES THAT TURN THE TOOL ARE ONLY IN THE KRL FORM" in text


@pytest.mark.parametrize("angle", [30.0, 90.0, 170.0])
def test_tolerance_gives_the_cdis(angle):
    assert corner_tolerance_mm(angle) == pytest.approx(
        CDIS_MM * np.cos(np.radians(angle / 2)) / 2, abs=1.0001e-4
    )


def test_program_elsewhere_and_slower(run, tmp_path):
    (tmp_path / "cell.toml").write_text(
        "based_on = 'demonstration'\n[controller]\nvel_cp_m_s = 0.1\n", encoding="utf-8"
    )
    outcome = run(
        "make-test", "controller", "-o", "-", "--cell", "cell.toml", "--at", "10", "20", "30", code=0
    )
    assert "G0 X10.000 Y20.000" in outcome.out
    assert "Z30.000" in outcome.out
    assert "F12000" not in outcome.out
    assert "clearance" in run("make-test", "controller", "-o", "t.nc", "--at", "0", "0", "900", code=2).err


# --- recovery -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k_cycles", "cdis_mm", "law"),
    [(14, 5.0, "averages"), (8, 2.3, "trapezoid"), (20, 11.0, "averages")],
)
def test_recovers_k_cdis_and_law(targets, text, cell, k_cycles, cdis_mm, law):
    truth = Controller(k_cycles * 0.012, cdis_mm, law)
    found = identify_controller(trace_of(text, truth), targets, cell)
    assert found.law == law
    assert found.k_cycles == k_cycles
    assert found.k_best_s == pytest.approx(truth.k_s, abs=1e-12)
    for estimate, true in ((found.k_s, truth.k_s), (found.cdis_mm, cdis_mm)):
        half = (estimate.high - estimate.low) / 2
        assert 0 < half < 0.005 * true
        assert abs(estimate.value - true) < 2.5 * half
    assert found.noise_mm == pytest.approx(0.005, rel=0.1)
    assert found.rms_mm == pytest.approx(0.005, rel=0.1)
    assert found.unmatched == 1  # the way down to the program's first position
    assert not [issue for issue in found.issues if issue.severity == "warning"]
    judged = [section for section in found.sections if not section.fitted]
    assert len(judged) == 2
    assert max(section.rms_mm for section in judged) < 0.006
    for corner in found.corners:
        half = corner.d_mm.high - corner.d_mm.value
        assert abs(corner.d_mm.value - cdis_mm) < 3.0 * half
        programmed = corner.programmed_d_mm * np.cos(np.radians(corner.angle_deg / 2)) / 2
        assert corner.error_mm.value == pytest.approx(programmed * corner.d_mm.value / CDIS_MM, rel=1e-6)


@pytest.mark.slow
def test_fast_samples_missing_rows_and_rounding_alone(targets, text, cell):
    truth = Controller(0.144, 4.0, "averages")
    trace = trace_of(text, truth, noise_mm=0.0, cycle_s=0.004)
    keep = np.random.default_rng(6).uniform(size=len(trace)) > 0.02
    kept = ControllerTrace(trace.time_s[keep], trace.position_mm[keep], trace.row[keep], 30, "trace.csv")
    found = identify_controller(kept, targets, cell)
    assert found.k_best_s == pytest.approx(0.144)
    assert found.cdis_mm.value == pytest.approx(4.0, abs=0.001)
    assert found.noise_mm == pytest.approx(0.001 / np.sqrt(12))
    assert "rows-dropped" in [issue.code for issue in found.issues]


def test_law_undecided_without_short_moves(cell):
    lines = "".join(f"G1 X{x} F1500\nG4 P0.3\n" for x in (150, 100, 150))
    text = HEAD + lines + "M5\nM30\n"
    found = identify_controller(trace_of(text, Controller(0.132)), targets_of(text, cell), cell)
    assert found.law == "undecided"
    assert abs(found.law_evidence) < 1e-3
    assert found.k_s.value == pytest.approx(0.132, abs=0.002)
    assert found.cdis_mm is None
    messages = [issue.message for issue in found.issues]
    assert any("cdis is not determined: the program has no blended corner" in text for text in messages)


def test_corners_limited_by_half_a_line_do_not_determine_cdis(cell):
    corner = "G64 P{p}\nG1 X{x} Y0 F3000\nG61\nG1 X{x} Y{y}\nG4 P0.3\nG1 X100 Y0\nG4 P0.3\n"
    text = HEAD + "".join(corner.format(p=4.0, x=100 + size, y=size) for size in (6, 8)) + "M5\nM30\n"
    targets = targets_of(text, cell)
    wide = np.where(targets.cdis_mm > 0, 5.0, 0.0)
    targets = type(targets)(**{**vars(targets), "cdis_mm": wide})
    found = identify_controller(trace_of(text, Controller(0.168, 5.0)), targets, cell)
    assert found.cdis_mm is None
    assert any("half a line limits every corner" in issue.message for issue in found.issues)
    assert [c.d_mm.value for c in found.corners] == pytest.approx([3.0, 4.0], abs=0.03)


@pytest.mark.slow
def test_another_acceleration_shows_as_misfit(targets, text, cell):
    other = cell.model_copy(update={"controller": cell.controller.model_copy(update={"acc_cp_m_s2": 1.0})})
    found = identify_controller(trace_of(text, Controller()), targets, other)
    misfit = [issue for issue in found.issues if issue.code == "law-misfit"]
    assert misfit
    assert found.rms_mm > 5 * found.noise_mm


def test_what_is_not_determined_is_refused(targets, text, cell, monkeypatch):
    monkeypatch.setattr(identify, "_WIDEST", 1e-5)
    with pytest.raises(RefusedError, match="k is not determined"):
        identify_controller(trace_of(text, Controller()), targets, cell)


# --- wrong traces ---------------------------------------------------------------------------------------


def changed(trace, rows=slice(None), **columns):
    values = {"time_s": trace.time_s, "position_mm": trace.position_mm, **columns}
    return ControllerTrace(
        values["time_s"][rows], values["position_mm"][rows], trace.row[rows], trace.dropped, trace.source
    )


def test_wrong_traces_are_told(targets, text, cell):
    trace = trace_of(text, Controller())
    half = len(trace) // 2
    moving = half + int(np.argmax(np.linalg.norm(np.diff(trace.position_mm[half:], axis=0), axis=1) > 1.0))
    paused = np.insert(trace.position_mm, np.repeat(moving, 40), trace.position_mm[moving], axis=0)
    longer = ControllerTrace(np.arange(len(paused)) * 0.012, paused, np.arange(len(paused)), 0, "trace.csv")
    cases = (
        (changed(trace, slice(0, half)), "the program 37; it ends before G-code line"),
        (changed(trace, position_mm=np.add(trace.position_mm, [0, 0, 12.5])), r"shifted .*12\.500"),
        (changed(trace, position_mm=trace.position_mm * 0.001), "column x_cmd_mm .* metres"),
        (longer, "the trace has 39 sections .* the program 37; they differ at standstill"),
    )
    for wrong, words in cases:
        with pytest.raises(NotUnderstoodError, match=words):
            identify_controller(wrong, targets, cell)


# --- the command ----------------------------------------------------------------------------------------


def test_command(run, tmp_path, text):
    write_csv(trace_of(text, Controller(0.156, 4.2)), tmp_path / "trace.csv")
    (tmp_path / "cell.toml").write_text(
        'name = "mine"\nbased_on = "demonstration"\n[controller]\nadvance = 4\n', encoding="utf-8"
    )
    outcome = run(
        "identify",
        "controller",
        "trace.csv",
        "--json",
        "--plot",
        "figure.png",
        "--apply",
        "cell.toml",
        code=0,
    )
    result = json.loads(outcome.out)
    assert result["k_s"] == pytest.approx(0.156, abs=1e-4)
    assert result["k_interval_s"][0] < result["k_s"] < result["k_interval_s"][1]
    assert (result["k_cycles"], result["law"]) == (13, "averages")
    assert result["cdis_mm"] == pytest.approx(4.2, abs=0.01)
    assert len(result["sections"]) == 37
    assert len(result["corners"]) == 12
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    cell = tomllib.loads((tmp_path / "cell.toml").read_text(encoding="utf-8"))
    assert cell["name"] == "mine"
    assert cell["controller"]["advance"] == 4
    assert (cell["controller"]["k_s"], cell["controller"]["law"]) == (0.156, "averages")
    assert "trace.csv" in cell["controller"]["source"]
    assert "cdis_mm" not in cell["controller"]  # G64 P set that of the test, not the cell
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cell.toml", "figure.png", "trace.csv"]


@pytest.mark.slow
def test_command_with_a_program_of_the_cells_cdis(run, tmp_path, text):
    lines = [line for line in text.splitlines() if not line.startswith("(")]
    own = "\n".join("G64" if line.startswith("G64") else line for line in lines)
    (tmp_path / "own.nc").write_text(own, encoding="utf-8")
    (tmp_path / "cell.toml").write_text(
        "based_on = 'demonstration'\n[controller]\ncdis_mm = 6.0\n", encoding="utf-8"
    )
    write_csv(trace_of(own, Controller(0.168, 5.0)), tmp_path / "trace.csv")
    arguments = ("--part", "own.nc", "--cell", "cell.toml", "--apply", "new.toml")
    assert "14 cycles of 12 ms" in run("identify", "controller", "trace.csv", *arguments, code=0).out
    cell = tomllib.loads((tmp_path / "new.toml").read_text(encoding="utf-8"))
    assert cell["controller"]["cdis_mm"] == pytest.approx(5.0, abs=0.01)


def test_command_without_a_trace(run):
    assert "none.csv: error" in run("identify", "controller", "none.csv", code=2).err
    run("identify", "controller", "none.csv", "--plot", "nowhere/figure.png", code=2)

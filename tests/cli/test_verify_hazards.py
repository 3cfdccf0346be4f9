"""``verify`` in the options a program was made with, and with a header that is not as it was written."""

import json
import shutil

import pytest

from tests.conftest import ROOT

pytestmark = pytest.mark.slow

EXAMPLES = ROOT / "examples"
SLOT = """G21 G90 G17 G40 G49 G80 G94 G54
T1 M6
S8000 M3
G0 G43 H1 Z20
G0 X0 Y0
G0 Z2
G1 Z-2 F600
G1 X40 F1500
G1 X41
G1 X80
G1 Y30
G0 X60
G0 Z20
M5
M30
"""
"""Line 12 is a rapid at the depth of the cut."""
CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[-20, -20, -20], [100, 50, 0]]\n'


@pytest.fixture
def slot(run, tmp_path):
    """Return part, cell and program, with its rapid at depth released by hand."""
    part, cell, src = tmp_path / "slot.nc", tmp_path / "cell.toml", tmp_path / "slot.src"
    part.write_text(SLOT)
    cell.write_text(CELL)
    run(part, "--cell", cell, "-o", src, "--allow", "rapid-in-stock", code=0)
    return part, cell, src


@pytest.fixture
def verified(run):
    """Verify, and return the record."""

    def verify(part, cell, src, *options):
        done = run("verify", src, part, "--cell", cell, "--json", *options)
        record = json.loads(done.out)
        assert record["exit_code"] == done.code
        return record

    return verify


def found(record, severity="error"):
    return {issue["code"] for issue in record["issues"] if issue["severity"] == severity}


def test_a_released_finding_is_listed_and_does_not_differ(verified, slot):
    record = verified(*slot)
    assert record["exit_code"] == 0, record["issues"]
    released = [issue for issue in record["issues"] if issue["code"] == "rapid-in-stock"]
    assert [issue["line"] for issue in released] == [12]
    assert released[0]["file"].endswith("slot.nc")
    assert "(released by hand)" in released[0]["message"]


def test_more_findings_than_were_released_differ(verified, slot):
    part, cell, src = slot
    cell.write_text(CELL.replace("50, 0]", "50, 5]"))  # now the rapid down to Z2 hits it too
    record = verified(part, cell, src)
    assert found(record) == {"verify-cell-changed", "rapid-in-stock"}
    assert any("released by hand were 1" in issue["message"] for issue in record["issues"])


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("hand: rapid-in-stock (whole file, 1)", "hand: rapid-in-stock (whole file, 9)", {"verify-header"}),
        ("; options: ", "; options: online=x ", {"verify-header"}),
        ("hand: rapid-in-stock (whole file, 1)", "hand: none", {"verify-header", "rapid-in-stock"}),
        ("stock ", "stock 0", {"verify-header", "verify-cell-changed"}),
        (", stock ", ", stuck ", {"verify-cell-changed"}),
    ],
)
def test_a_header_changed_by_hand_differs(verified, slot, before, after, expected):
    part, cell, src = slot
    text = src.read_bytes()
    assert text.count(before.encode()) >= 1
    at = text.rindex(before.encode()) if before.startswith("stock") else text.index(before.encode())
    src.write_bytes(text[:at] + after.encode() + text[at + len(before) :])
    record = verified(part, cell, src)
    assert record["exit_code"] == 1
    assert found(record) == expected


def test_a_program_without_hashes_is_judged_all_the_same(verified, slot):
    part, cell, src = slot
    lines = src.read_bytes().splitlines(keepends=True)
    src.write_bytes(b"".join(line for line in lines if not line.startswith(b"; cell hash")))
    record = verified(part, cell, src)
    assert record["exit_code"] == 0
    assert "verify-cell-unknown" in found(record, "warning")
    assert "rapid-in-stock" in found(record, "warning")
    cell.write_text(CELL.replace("50, 0]", "50, 5]"))
    assert verified(part, cell, src)["exit_code"] == 1, "two findings, one was released"
    assert verified(part, cell, src, "--no-forces")["exit_code"] == 0


def test_an_allowed_finding(verified, slot):
    part, cell, src = slot
    src.write_bytes(src.read_bytes().replace(b"; cell hash", b"; hash"))
    src.write_bytes(src.read_bytes().replace(b"rapid-in-stock (whole file, 1)", b"none"))
    assert verified(part, cell, src)["exit_code"] == 1
    assert verified(part, cell, src, "--allow", "rapid-in-stock:12")["exit_code"] == 0


CASES = {
    "test piece": ("test_piece.nc", None, [], []),
    "cam style": ("cam_style.nc", None, [], []),
    "five axes": ("five_axis/five_axis.nc", "five_axis/cell.toml", [], []),
    "rail": ("external/long_part.nc", "external/robot_on_rail.toml", [], []),
    "simplified": ("test_piece.nc", None, ["--simplify", "0.02"], ["--simplify", "0.02"]),
    "files": ("test_piece.nc", None, ["--split", "files", "--max-lines", "100"], []),
    "online": ("test_piece.nc", None, ["--online", "HZ"], []),
    "no forces": ("test_piece.nc", None, ["--no-forces"], []),
    "restart": ("test_piece.nc", None, ["--from-line", "30"], ["--from-line", "30"]),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "rail" else []) for name in CASES]
)
def test_an_example_with_its_own_cell_agrees(run, tmp_path, name):
    part, cell, options, stated = CASES[name]
    nc, src = tmp_path / "part.nc", tmp_path / "made.src"
    shutil.copy(EXAMPLES / part, nc)
    named = [] if cell is None else ["--cell", EXAMPLES / cell]
    run(nc, "-o", src, *named, *options, code=0)
    checked = run("verify", src, nc, *named, *stated, code=0)
    assert "agrees with" in checked.out
    assert "cell hash" not in checked.err


def test_a_compensated_program_agrees(run, tmp_path):
    nc, cell = tmp_path / "part.nc", tmp_path / "cell.toml"
    nc.write_text(SLOT.replace("G0 X60\n", "").replace("Z-2", "Z-0.5"))
    cell.write_text(CELL + "[material]\nrelative_band = 0.1\n")
    options = ("--cell", cell, "--compensate", "offline")
    run(nc, "-o", tmp_path / "made.src", *options, code=0)
    run("verify", tmp_path / "made.src", nc, *options, code=0)


G43, LONGER = "G0 G43 H1 Z20", "[tool.1]\ndiameter_mm = 10.0\nteeth = 2\nlength_mm = 104.0\n"


@pytest.mark.parametrize("call", [G43, "G0 Z20"])
def test_a_longer_cutter_is_told_with_and_without_g43(run, verified, tmp_path, call):
    part, cell, src = tmp_path / "slot.nc", tmp_path / "cell.toml", tmp_path / "slot.src"
    part.write_text(SLOT.replace(G43, call).replace("G0 X60\n", ""))
    head, _, stock = CELL.partition("[stock]")
    program = '[program]\ntool_length = "from_table"\n' if call != G43 else ""
    cell.write_text(f"{head}{program}[stock]{stock}{LONGER.replace('104', '100')}")
    assert run(part, "--cell", cell, "-o", src).code == 0
    assert verified(part, cell, src)["exit_code"] == 0
    cell.write_text(f"{head}{program}[stock]{stock}{LONGER}")
    record = verified(part, cell, src)
    sentences = [i["message"] for i in record["issues"] if i["code"] == "verify-cell-changed"]
    assert sentences == ["tool.1: not as when the program was written"]

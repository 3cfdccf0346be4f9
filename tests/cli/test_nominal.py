"""``predict --nominal part.stl`` as a user meets it: findings with lines, figures, files, and the report."""

import json

import pytest
import trimesh

CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[0, 0, -20], [60, 40, 0]]\n'
SLOT = "G21 G90\nT1 M6\nG0 G43 H1 Z20\nS8000 M3\nG0 X-20 Y20\nG0 Z-4\nG1 X80 F1200\nG0 Z20\nM5\nM30\n"
WORDS = ("predict", "slot.nc", "--cell", "cell.toml", "--nominal", "nominal.stl", "-o", "prediction")


@pytest.fixture
def folder(run, tmp_path):
    """A slot 4 mm deep in a block, where 2.5 mm are wanted, and a pocket that nobody cuts."""
    (tmp_path / "cell.toml").write_text(CELL, encoding="ascii")
    (tmp_path / "slot.nc").write_text(SLOT, encoding="ascii")
    nominal = trimesh.creation.box(bounds=[[0, 0, -20], [60, 40, 0]])
    for low, high in (([-1, 12, -2.5], [61, 28, 1]), ([20, 32, -3], [40, 38, 1])):
        nominal = nominal.difference(trimesh.creation.box(bounds=[low, high]), engine="manifold")
    nominal.export(tmp_path / "nominal.stl")
    return tmp_path


def test_findings_figures_and_files(run, folder):
    result = json.loads(run(*WORDS, "--json", code=0).out)
    gouge, rest = result["nominal"]["differences"]
    assert (gouge["kind"], rest["kind"]) == ("gouge", "rest")
    assert gouge["depth_mm"] == pytest.approx(1.5, abs=0.01)
    assert rest["volume_mm3"] == pytest.approx(3 * 20 * 6, rel=0.05)
    codes = {issue["code"]: issue for issue in result["issues"]}
    assert codes["nominal-gouge"]["severity"] == "warning"
    assert codes["nominal-gouge"]["line"] == 7
    assert "up to 1.50 mm into the nominal part" in codes["nominal-gouge"]["message"]
    assert codes["nominal-rest"]["message"].startswith("up to 3.00 mm of material is left in one place")
    for name, one in (("gouges.stl", gouge), ("rest.stl", rest)):
        solid = trimesh.load(folder / "prediction" / name)
        assert solid.is_watertight
        assert solid.volume == pytest.approx(one["volume_mm3"], rel=0.05)


@pytest.mark.slow
def test_the_summary_names_both(run, folder):
    done = run(*WORDS)
    assert "  gouges     14" in done.out
    assert "mm3, up to 1.50 mm" in done.out
    assert "  rest       3" in done.out
    assert "slot.nc:7: warning: cuts up to 1.50 mm into the nominal part" in done.err


@pytest.mark.slow
def test_the_report_shows_them_if_the_part_is_unchanged(run, folder):
    run(*WORDS)
    assert run("report", "prediction", "-o", "report.html").code == 0
    assert "Against the nominal part" in (folder / "report.html").read_text(encoding="utf-8")
    (folder / "nominal.stl").rename(folder / "elsewhere.stl")
    assert "nominal.stl is not at hand" in run("report", "prediction", "-o", "report.html").err
    assert "Against the nominal part" not in (folder / "report.html").read_text(encoding="utf-8")
    assert run("report", "prediction", "-o", "report.html", "--nominal", "elsewhere.stl").code == 0
    assert "Against the nominal part" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_solids_of_an_earlier_prediction_go(run, folder):
    run(*WORDS)
    assert (folder / "prediction" / "rest.stl").is_file()
    assert run("predict", "slot.nc", "--cell", "cell.toml", "-o", "prediction").code == 0
    assert not (folder / "prediction" / "rest.stl").exists()
    assert not (folder / "prediction" / "gouges.stl").exists()


def test_a_part_as_wanted(run, folder):
    nominal = trimesh.creation.box(bounds=[[0, 0, -20], [60, 40, 0]])
    slot = trimesh.creation.box(bounds=[[-1, 12, -4], [61, 28, 1]])
    nominal.difference(slot, engine="manifold").export(folder / "nominal.stl")
    done = run(*WORDS)
    assert "gouges     none" in done.out
    assert "rest       none" in done.out
    run("report", "prediction", "-o", "report.html")
    assert "No gouge and no rest" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "cannot read the nominal part: no such file"),
        (b"solid nothing", "nominal.stl"),
    ],
)
def test_a_part_that_cannot_be_read(run, folder, content, sentence):
    if content is None:
        (folder / "nominal.stl").unlink()
    else:
        (folder / "nominal.stl").write_bytes(content)
    assert sentence in run(*WORDS, code=2).err
    assert not (folder / "prediction").exists()


def test_the_nominal_part_is_never_written_over(run, folder):
    (folder / "prediction").mkdir()
    run("predict", "slot.nc", "-o", "prediction", "--nominal", "prediction/rest.stl", code=2)

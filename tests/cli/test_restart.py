"""``--from-line`` as a user meets it."""

import json

import pytest

SLOT = (
    "G21 G90 G17\nT1 M6\nS12000 M3\nG0 X-20 Y0\nG0 G43 H1 Z50\nG0 Z5\n"
    "G1 Z-5 F600\nG1 X100 F1500\nG1 X180\nG0 Z50\nM30\n"
)


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "slot.nc"
    path.write_text(SLOT, encoding="ascii")
    return path


def test_name_header_and_summary_say_that_it_is_a_restart(run, part, tmp_path):
    done = run(part, "--from-line", 9, code=0)
    assert "restart    from line 9" in done.out
    assert "T1, M3 S12000" in done.out
    text = (tmp_path / "slot_from9.src").read_text("ascii")
    assert "RESTART AT G-CODE LINE 9. NOT FOR A RAW PART." in text
    assert "from_line=9" in text
    assert text.count("; restart: from above down to the start of line 9\nPTP {X 100.000") == 1
    assert len({len(line) for line in text.splitlines() if line.startswith("; **")}) == 1  # a closed frame


def test_json_has_the_restart(run, part):
    result = json.loads(run(part, "-o", "SLOT.src", "--from-line", 9, "--json").out)
    assert result["restart"]["line"] == 9
    assert result["restart"]["begins_line"] == 9
    assert result["restart"]["way_mm"][-1] == [100.0, 0.0, -5.0]
    assert result["time_s"] < 20


def test_it_verifies_with_its_line(run, part):
    assert run(part, "--from-line", 9).code == 0
    assert run("verify", "slot_from9.src", part, "--from-line", 9).code == 0


@pytest.mark.parametrize("options", [(), ("--from-line", 8)])
def test_verify_names_the_line_that_it_needs(run, part, options):
    assert run(part, "--from-line", 9).code == 0
    done = run("verify", "slot_from9.src", part, *options, code=2)
    assert "it begins at G-code line 9" in done.err
    assert "-> --from-line 9" in done.err


def test_verify_sees_another_path_behind_the_start(run, part, tmp_path):
    assert run(part, "--from-line", 9).code == 0
    program = tmp_path / "slot_from9.src"
    text = program.read_bytes().decode("ascii")
    assert "LIN {X 180.000" in text
    program.write_bytes(text.replace("LIN {X 180.000", "LIN {X 181.000").encode("ascii"))
    assert "[verify-position]" in run("verify", "slot_from9.src", part, "--from-line", 9, code=1).err


def test_a_whole_program_is_no_restart(run, part):
    assert run(part, "-o", "SLOT.src").code == 0
    assert run("verify", "SLOT.src", part, "--from-line", 9).code == 1


def test_a_long_name_keeps_the_line(run, tmp_path):
    path = tmp_path / "a_rather_long_name_of_a_part.nc"
    path.write_text(SLOT, encoding="ascii")
    assert run(path, "--from-line", 9).code == 0
    assert (tmp_path / "A_RATHER_LONG_NAME_FROM9.src").exists()


def test_a_given_name_stands(run, part, tmp_path):
    assert run(part, "--from-line", 9, "--name", "MINE").code == 0
    assert (tmp_path / "MINE.src").exists()


@pytest.mark.parametrize(
    ("line", "words"), [(3, "moves nothing"), (11, "behind the last"), (4, "change to T1")]
)
def test_a_bad_line_is_one_clear_line(run, part, tmp_path, line, words):
    (said,) = run(part, "--from-line", line, code=2).err.strip().splitlines()
    assert words in said
    assert "[restart-line] -> --from-line" in said
    assert not list(tmp_path.glob("*.src"))


def test_no_forces_is_refused(run, part):
    assert "--no-forces" in run(part, "--from-line", 9, "--no-forces", code=2).err


def test_offline_compensation_begins_with_the_material_that_is_left(run, part):
    part.write_text(SLOT.replace("Z-5", "Z-1"), encoding="ascii")
    cell = part.with_name("measured.toml")
    cell.write_text('based_on = "demonstration"\n[material]\nrelative_band = 0.1\n', encoding="utf-8")
    done = run(part, "--cell", cell, "--from-line", 9, "--compensate", "offline", "--json", code=0)
    assert "slot_from9.src" in json.loads(done.out)["files"][0]

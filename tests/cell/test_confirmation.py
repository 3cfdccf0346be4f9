"""What a person confirmed stays confirmed until a value of it changes, wherever that is edited."""

import json
import random
import shutil
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
import tomli_w

from gcode2krl import load_cell
from gcode2krl.cell import as_toml, cell_from_resolved, confirmation, library
from gcode2krl.cell.confirmation import confirmation_issues, signers
from gcode2krl.cell.confirmation import signed as signature_of
from gcode2krl.cell.fingerprint import section_of, values_by_section
from gcode2krl.cell.signature_text import with_signature, without_signature
from gcode2krl.errors import NotUnderstoodError
from tests.cells import OWN_CELL, signed
from tests.conftest import ROOT, draws

EXAMPLES = sorted((ROOT / "examples" / "cells").glob("*.toml"))
PART = (ROOT / "examples" / "cells" / "part.nc").read_text()
HALT = 'MSG_TXT[] "Cell file '
BY, DAY = "N. N.", "2026-11-28"


def confirm(file: Path, by: str = BY, day: str = DAY, sections=()) -> None:
    """Sign a cell file as `gcode2krl models confirm` does."""
    cell = load_cell(file)
    signature = signature_of(cell, by, day, sections or values_by_section(cell))
    text = file.read_bytes().decode("utf-8")
    text = with_signature(text, signature.model_dump(mode="json", exclude_none=True))
    file.write_bytes(text.encode("utf-8"))


@pytest.fixture
def models(tmp_path, monkeypatch) -> Path:
    """The model library, as a copy that a test may edit."""
    copy = tmp_path / "models"
    shutil.copytree(library.models_folder(), copy)
    monkeypatch.setattr(library, "models_folder", lambda: copy)
    return copy


@pytest.fixture
def example(tmp_path):
    """Return a function that confirms a copy of an example cell; ``based`` moves all of it into a base."""

    def copied(source: Path, is_based: bool = False) -> Path:
        (tmp_path / "part.nc").write_text(PART)
        file = tmp_path / "cell.toml"
        shutil.copy(source, tmp_path / "base.toml" if is_based else file)
        if is_based:
            file.write_text('based_on = "base.toml"\n[table]\nz_mm = -61.0\n')
        confirm(file)
        return file

    return copied


# --- edits ------------------------------------------------------------------------------------------------


class Edit(NamedTuple):
    key: str
    where: str
    """``cell``, ``base`` or ``library``."""


def other_value(value, rng):
    """Return a value near another one, of the same type."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return round(value * 1.01 + 0.01, 6)
    if isinstance(value, list):
        place = rng.randrange(len(value))
        return [*value[:place], other_value(value[place], rng), *value[place + 1 :]]
    return f"{value}\n; edited" if "\n" in value or " " in value else f"{value}1"


def put(data: dict, resolved: dict, key: str, rng) -> bool:
    """Change a dotted key of a file's data; a list of tables, and a frame, is stated whole then."""
    steps = key.split(".")
    for step in steps[:-1]:
        if isinstance(resolved, list):
            data, resolved = data[int(step) - 1], resolved[int(step) - 1]
            continue
        if step not in resolved:  # the name has a dot of its own
            return False
        below = resolved[step]
        whole = isinstance(below, list) or "a_deg" in below
        if whole:
            data[step] = json.loads(json.dumps(below))
        data, resolved = data.setdefault(step, {}), below
    data[steps[-1]] = other_value(resolved[steps[-1]], rng)
    return True


MODELS = {"robot": "robots", "controller": "controllers", "material": "materials", "tool": "tools"}


def edited(file: Path, models: Path, rng) -> Edit | None:
    """Edit one random value of a confirmed cell, where it can be edited; None where that is no cell."""
    cell = load_cell(file)
    values = values_by_section(cell)
    key = rng.choice(list(values[rng.choice(list(values))]))
    base = file.with_name("base.toml")
    where = rng.choice(["library", "base" if base.exists() else "cell"])
    resolved, target, name = as_toml(cell), file, key
    section = section_of(key)
    if where == "library":
        kind = MODELS.get(section.partition(".")[0])
        table = resolved["tool"][section[5:]] if kind == "tools" else resolved.get(section, {})
        target = library.names(kind).get(table.get("model", "")) if kind else None
        if target is None:
            where, target = "cell", file
        else:
            name, resolved = key[len(section) + 1 :], table
    elif where == "base":
        target = base
    before = target.read_bytes()
    data = tomllib.loads(before.decode("utf-8-sig"))
    if not put(data, resolved, name, rng):
        return None
    target.write_bytes(tomli_w.dumps(data).encode())
    library._of_library.cache_clear()
    try:
        after = load_cell(file)
    except NotUnderstoodError:
        after = None
    if after is None or values_by_section(after) == values_by_section(
        cell
    ):  # not allowed, or hidden by the cell
        target.write_bytes(before)
        library._of_library.cache_clear()
        return None
    return Edit(key, where)


def draw(count, example, models, run, tmp_path, seed) -> list[Edit]:
    """Make ``count`` edits of confirmed cells whose programs are written; check each program."""
    rng = random.Random(seed)
    pristine = tmp_path / "pristine"
    shutil.copytree(models, pristine)
    edits: list[Edit] = []
    for _ in range(20 * count):
        if len(edits) == count:
            break
        file = example(rng.choice(EXAMPLES), is_based=rng.random() < 0.4)
        edit = edited(file, models, rng)
        if edit is None:
            continue
        done = run("part.nc", "--cell", "cell.toml", "-o", "part.src")
        changed = {one.key for one in load_cell(file).unconfirmed}
        assert edit.key in changed or section_of(edit.key) in changed, (edit, changed)
        shutil.rmtree(models)
        shutil.copytree(pristine, models)
        library._of_library.cache_clear()
        if done.code:  # the edited value leads out of reach, too fast …: there is no program
            continue
        text = (tmp_path / "part.src").read_text()
        assert HALT in text, edit
        assert "[cell-changed]" in done.err, edit
        assert edit.key in text.partition("defaults that")[0], edit
        assert edit.key in done.err, edit
        edits.append(edit)
    return edits


def test_an_edited_value_unconfirms_its_section_and_is_named(example, models, run, tmp_path):
    edits = draw(8, example, models, run, tmp_path, seed=1)
    assert len(edits) == 8


@pytest.mark.slow
def test_many_drawn_edits(example, models, run, tmp_path):
    count = draws(40)
    edits = draw(count, example, models, run, tmp_path, seed=2)
    places = {where: sum(edit.where == where for edit in edits) for where in ("cell", "base", "library")}
    sections = {section_of(edit.key) for edit in edits}
    print(f"{len(edits)} edits, {len(edits)} programs with HALT; {places}, {len(sections)} sections")
    assert len(edits) == count
    assert min(places.values()) >= 2
    assert len(sections) >= 12


WHO = "confirmed by N. N. on 2026-11-28"


@pytest.mark.parametrize(
    ("line", "edited_line", "message"),
    [
        ("z_mm = 150.0", "z_mm = 151.0", f"clearance.z_mm is 151.0; 150.0 was {WHO}"),
        ("[table]\nz_mm = -60.0", "", f"table.z_mm is gone; -60.0 was {WHO}"),
        ("[home]", "[frames.robroot]\nx_mm=0\ny_mm=0\nz_mm=9\na_deg=0\nb_deg=0\nc_deg=0\n[home]",
         f"frames.robroot.z_mm is 9.0; it was not there when the section was {WHO}"),
        ("[home]", "[stock]\nbox_mm = [[0, 0, -9], [9, 9, 0]]\n[home]", "stock: nobody has confirmed it"),
        ("mist_output = 14", "mist_output = 24", f"spindle.mist_output is 24; 14 was {WHO}"),
        ('M8 = "', 'M8 = "WAIT SEC 1\\n', "m_code.M8 is \"WAIT SEC 1"),
        ("[home]", "[online.gains]\np = 0.4\n[home]", f"online.gains.p is 0.4; another value was {WHO}"),
    ],
)  # fmt: skip
def test_an_edit_is_told_with_what_was_confirmed(example, line, edited_line, message):
    file = example(ROOT / "examples" / "cells" / "spindle_on_analog_output.toml")
    text = file.read_text()
    assert line in text
    file.write_text(text.replace(line, edited_line, 1))
    cell = load_cell(file)
    assert not cell.is_confirmed
    issues = confirmation_issues(cell)
    assert {issue.code for issue in issues} == {"cell-changed"}
    assert any(issue.message.startswith(message) for issue in issues), issues
    assert all("models confirm" in issue.remedy for issue in issues)


def test_a_default_of_another_release_was_not_confirmed(tmp_path, monkeypatch):
    now = values_by_section(load_cell())
    older = {
        **now,
        "controller": {key: value for key, value in now["controller"].items() if "circ" not in key},
    }
    older["spindle"] = now["spindle"] | {"spindle.start_s": 4.0}
    with monkeypatch.context() as patch:
        patch.setattr(confirmation, "values_by_section", lambda _: older)
        data = signed(OWN_CELL)
    (tmp_path / "cell.toml").write_text(tomli_w.dumps(data))
    cell = load_cell(tmp_path / "cell.toml")
    assert [(one.key, one.kind, one.was) for one in cell.unconfirmed] == [
        ("spindle.start_s", "changed", "4.0"),
        ("controller.circ", "new", ""),
    ]


def test_what_is_in_a_mesh_was_confirmed_and_where_it_lies_was_not(tmp_path):
    import trimesh

    trimesh.creation.box((100, 100, 100)).export(tmp_path / "clamp.stl")
    data = OWN_CELL | {"obstacle": [{"name": "clamp", "mesh": "clamp.stl", "frame": "base"}]}
    (tmp_path / "cell.toml").write_text(tomli_w.dumps(signed(data, beside=tmp_path)))
    elsewhere = shutil.copytree(tmp_path, tmp_path / "elsewhere")
    assert load_cell(elsewhere / "cell.toml").is_confirmed
    trimesh.creation.box((100, 100, 101)).export(elsewhere / "clamp.stl")
    assert [one.key for one in load_cell(elsewhere / "cell.toml").unconfirmed] == ["obstacle.1.mesh"]


# --- signatures -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "count"),
    [
        ('by = "N. N."', 'by = "Somebody else"', 99),
        (f'date = "{DAY}"', 'date = "2026-11-27"', 99),
        ('"clearance.z_mm" = 150.0', '"clearance.z_mm" = 151.0', 1),
        ('"clearance.z_mm" = 150.0', '"clearance.z_mm" = 150.0\n"clearance.y_mm" = 1.0', 1),
        ('"clearance.z_mm" = 150.0\n', "", 1),
        ("cycle_s f02deddb", "cycle_s f02deddc", 1),
        ('home = { hash = "', 'home = { by = "X", hash = "', 1),
    ],
)
def test_a_forged_signature_confirms_nothing(example, old, new, count):
    file = example(ROOT / "examples" / "cells" / "spindle_on_analog_output.toml")
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    cell = load_cell(file)
    forged = [one for one in cell.unconfirmed if one.kind == "forged"]
    assert not cell.is_confirmed
    assert len(forged) == min(count, len(values_by_section(cell)))
    assert "cell-unsigned" in {issue.code for issue in confirmation_issues(cell)}


def test_a_line_written_by_hand_confirms_nothing(tmp_path, run):
    (tmp_path / "part.nc").write_text(PART)
    source = (ROOT / "examples" / "cells" / "spindle_on_analog_output.toml").read_text()
    line = 'verified = { by = "N. N.", date = "2026-11-28" }\n'
    (tmp_path / "cell.toml").write_text(line + source)
    done = run("part.nc", "--cell", "cell.toml", "-o", "part.src")
    assert "[cell-unsigned]" in done.err
    assert "gcode2krl models confirm" in done.err
    assert HALT in (tmp_path / "part.src").read_text()
    confirm(tmp_path / "cell.toml")
    text = (tmp_path / "cell.toml").read_text()
    assert text.startswith(source)
    assert load_cell(tmp_path / "cell.toml").is_confirmed


def test_a_section_is_confirmed_again_by_another_and_the_others_stay(example):
    file = example(ROOT / "examples" / "cells" / "change_by_hand.toml")
    sections = set(values_by_section(load_cell(file)))
    before = file.read_text().replace("x_mm = 260.0", "x_mm = 261.0", 1)
    file.write_text(before)
    assert {section_of(one.key) for one in load_cell(file).unconfirmed} == {"frames"}
    confirm(file, by="M. M.", day="2026-12-01", sections=["frames"])
    cell = load_cell(file)
    assert cell.is_confirmed
    assert signers(cell.verified) == ["N. N. on 2026-11-28", "M. M. on 2026-12-01 (frames)"]
    confirm(file, by="M. M.", day="2026-12-01", sections=sections - {"frames"})
    cell = load_cell(file)
    assert cell.is_confirmed
    assert signers(cell.verified) == ["M. M. on 2026-12-01"]
    text = file.read_text().replace("x_mm = 261.0", "x_mm = 260.0", 1)
    begin = text.index("[tool.2]")
    file.write_text(text[:begin] + text[text.index("\n[", begin) + 1 :])
    confirm(file, by="A", day="2026-12-02", sections=["home"])
    different = load_cell(file).unconfirmed
    assert {section_of(one.key) for one in different} == {"frames", "tool.2"}
    assert {one.kind for one in different} == {"changed", "removed"}
    confirm(file, by="A", day="2026-12-02", sections=["frames", "tool.2"])
    assert load_cell(file).is_confirmed


OLD = "[verified]  # old\nby = 'x'\ndate = '2026-01-01'\n"
BELOW = "\n[table]\nz_mm = -99.0  # \u2028\n"


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("begin", ["", "\ufeff", 'verified.by = "x"\nverified.date = "2026-01-01"\n'])
@pytest.mark.parametrize("end", ["", "\n\n# the end, without a line end", f"\n{OLD}{BELOW}"])
def test_the_rest_of_the_text_stays_to_the_byte(tmp_path, newline, begin, end):
    if begin.startswith("v") and "[verified]" in end:
        pytest.skip("not TOML")
    source = (ROOT / "examples" / "cells" / "change_by_hand.toml").read_text().rstrip("\n")
    file = tmp_path / "cell.toml"
    file.write_bytes(f"{begin}{source}{end}".replace("\n", newline).encode())
    kept = "\ufeff" if begin == "\ufeff" else ""
    rest = f"{kept}{source}{end.replace(OLD, '')}".replace("\n", newline).encode()
    for day in (DAY, "2026-12-01"):
        confirm(file, day=day)
        written = file.read_bytes()
        assert written.startswith(rest)
        assert written.count(b"[verified]") == 1
        assert (b"\r\n" in written) == (newline == "\r\n")
        assert newline == "\n" or written.count(b"\n") == written.count(b"\r\n")
        assert load_cell(file).is_confirmed
    confirm(file, day="2026-12-01")
    assert file.read_bytes() == written
    assert without_signature(written.decode()).encode().rstrip() == rest.rstrip()


# --- a confirmed cell -------------------------------------------------------------------------------------


def test_an_unedited_cell_runs_without_halt_from_anywhere_and_under_a_job(example, run, tmp_path):
    file = example(ROOT / "examples" / "cells" / "spindle_on_analog_output.toml")
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    (tmp_path / "job.toml").write_text(
        "[tool.1]\ndiameter_mm = 12.0\nteeth = 4\n[stock]\nbox_mm = [[-99, -99, -40], [99, 99, 0]]\n"
    )
    (tmp_path / "deep" / "er").mkdir(parents=True)
    shutil.copy(file, tmp_path / "deep" / "er" / "cell.toml")
    under = ["--cell", "cell.toml", "--job", "job.toml", "--max-lines", "200", "--tolerance", "0.2"]
    for words in (["--cell", "cell.toml"], ["--cell", "deep/er/cell.toml"], under):
        done = run("part.nc", "-o", "part.src", *words)
        text = (tmp_path / "part.src").read_text()
        assert done.code == 0, done.err
        assert f"; cell verified by {BY} on {DAY}" in text
        assert HALT not in text
        assert "[cell-" not in done.err
    file.write_text(file.read_text().replace("length_mm = 112.5", "length_mm = 113.0"))
    run("part.nc", "-o", "part.src", "--cell", "cell.toml", "--job", "job.toml")
    assert "tool.1.length_mm is 113.0; 112.5 was confirmed" in (tmp_path / "part.src").read_text()


def test_a_copy_with_other_values_is_confirmed_by_nobody(example):
    cell = load_cell(example(ROOT / "examples" / "cells" / "change_by_hand.toml"))
    assert cell.is_confirmed
    assert cell.model_copy().is_confirmed
    assert not cell.model_copy(update={"clearance": cell.clearance}).is_confirmed
    assert cell.under(stock=None).is_confirmed
    again = cell_from_resolved(tomllib.loads(tomli_w.dumps(as_toml(cell))), "a prediction")
    assert again == cell
    assert again.is_confirmed


def test_a_cell_on_another_names_what_changed_in_its_base(example):
    file = example(ROOT / "examples" / "cells" / "change_by_hand.toml", is_based=True)
    cell = load_cell(file)
    assert (cell.unconfirmed, cell.is_confirmed) == ((), False)
    [note] = confirmation_issues(cell)
    assert note.code == "cell-not-verified"
    assert "takes over from another" in note.message
    base = file.with_name("base.toml")
    base.write_text(base.read_text().replace("x_mm = 260.0", "x_mm = 261.0", 1))
    assert [one.key for one in load_cell(file).unconfirmed] == ["frames.tool.x_mm"]

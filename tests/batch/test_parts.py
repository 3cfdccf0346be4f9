"""Which parts a word names: folders, patterns, lists, tables; what two words may not do."""

import os
from pathlib import Path

import pytest

from gcode2krl.batch.parts import ENDINGS, find_parts
from gcode2krl.batch.planning import alike, program_name, refuse_collisions
from gcode2krl.errors import NotUnderstoodError


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("parts/b.nc", "parts/a.NGC", "parts/Größe 2/c d.tap", "parts/notes.txt", "more/a.nc"):
        place = Path(name)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text("M30\n")
    return tmp_path


def keys(*words, **settings):
    return [part.key for part in find_parts(words, **settings)]


def test_a_folder_is_all_its_gcode_sorted(folder):
    assert keys("parts") == ["Größe 2/c d.tap", "a.NGC", "b.nc"]
    assert {part.folder for part in find_parts(["parts"])} == {"", "Größe 2/"}


def test_several_folders_keep_their_names(folder):
    assert keys("parts", "more") == ["more/a.nc", "parts/Größe 2/c d.tap", "parts/a.NGC", "parts/b.nc"]


def test_a_pattern_is_expanded_here(folder):
    assert keys("parts/**/*.tap") == ["Größe 2/c d.tap"]
    assert keys(os.path.join("parts", "*.nc")) == ["b.nc"]  # noqa: PTH118 - as Windows writes it


def test_files_and_files_named_like_patterns(folder):
    Path("part[1].nc").write_text("M30\n")
    assert keys("parts/b.nc", "more/a.nc", "part[1].nc") == ["a.nc", "b.nc", "part[1].nc"]


def test_a_list(folder):
    Path("more/list.txt").write_text("# two\n../parts/b.nc\n\na.nc\n", encoding="utf-8-sig")
    assert keys("@more/list.txt") == ["a.nc", "b.nc"]
    Path("bad.txt").write_text("more/a.nc\nnothing.nc\n")
    with pytest.raises(NotUnderstoodError, match=r"bad\.txt:2: error: nothing\.nc: no such file"):
        keys("@bad.txt")


def test_a_table_has_a_cell_for_each_folder(folder):
    Path("cells.toml").write_text(
        '[[folder]]\npath = "parts"\ncell = "left.toml"\n'
        '[[folder]]\npath = "more/*.nc"\ncell = "right.toml"\njob = "job.toml"\n'
    )
    found = {part.key: (part.cell, part.job) for part in find_parts([str(folder / "cells.toml")])}
    left, right, job = (folder / name for name in ("left.toml", "right.toml", "job.toml"))
    assert found == {
        "a.nc": (right, job),
        "parts/Größe 2/c d.tap": (left, None),
        "parts/a.NGC": (left, None),
        "parts/b.nc": (left, None),
    }


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("folder = 1", "batch-table"),
        ("[[folder]]\ncell = 'a.toml'", "has no path"),
        ("[[folder]]\npath = 'parts'\ncel = 'a.toml'", "cel is no key"),
        ("[[folder]]\npath = 'parts'\n[other]", "something beside it"),
        ("[[folder", "not-toml"),
        ("[[folder]]\npath = 'nowhere'", "no such file"),
    ],
)
def test_a_wrong_table(folder, text, word):
    Path("cells.toml").write_text(text)
    with pytest.raises(NotUnderstoodError, match=word):
        keys("cells.toml")


@pytest.mark.parametrize("word", ["nowhere", "parts/*.xyz", "empty", "@none.txt", "none.toml"])
def test_a_word_that_names_nothing(folder, word):
    Path("empty").mkdir()
    with pytest.raises(NotUnderstoodError, match="file-unreadable"):
        keys(word)


def test_the_same_file_twice_is_one_part(folder):
    assert keys("parts/b.nc", "parts/*.nc") == ["b.nc"]


def test_two_parts_with_one_name_are_an_error_that_names_both(folder):
    Path("other").mkdir()
    Path("other/b.nc").write_text("M30\n")
    with pytest.raises(
        NotUnderstoodError, match=r"parts.b\.nc and other.b\.nc would both be written as b\.nc"
    ):
        keys("parts/b.nc", "other/b.nc")


def test_two_parts_with_one_program_name_are_an_error_that_names_both(folder):
    Path("parts/B.ngc").write_text("M30\n")
    parts = find_parts(["parts"])
    with pytest.raises(NotUnderstoodError, match=r"B\.ngc and .*b\.nc would both be written as"):
        refuse_collisions(parts, lambda part: program_name(part, ()))


def test_a_name_that_a_controller_does_not_take_is_made_good(folder):
    names = [program_name(part, ("C_D",)) for part in find_parts(["parts"])]
    assert names == ["C_D_1", "a", "b"]


def test_alike_names_in_different_folders_are_a_note(folder):
    parts = find_parts(["parts", "more"])
    found = alike(parts, lambda part: program_name(part, ()))
    assert set(found) == {"parts/a.NGC", "more/a.nc"}
    assert found["more/a.nc"].message == "parts/a.NGC has the program name a too"
    assert found["more/a.nc"].severity == "note"


def test_endings_are_lower_case():
    assert {".nc", ".ngc", ".gcode", ".tap", ".cnc", ".mpf"} <= ENDINGS
    assert all(ending == ending.lower() and ending.startswith(".") for ending in ENDINGS)

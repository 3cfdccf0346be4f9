"""Whole programs in the manner of CAM posts, by the command that a user types (tests/reference/posts)."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode
from tests.cells import over_demonstration

POSTS = Path(__file__).parents[1] / "reference" / "posts"
TABLE = tomllib.loads((POSTS / "posts.toml").read_text(encoding="utf-8"))["post"]
BY_RS274 = json.loads((POSTS / "rs274.json").read_text(encoding="ascii"))
OWN_FILES = {"README.md", "make.py", "posts.toml", "rs274.json", "tool.tbl"}
REMEDIED = [post for post in TABLE if "first" in post]
WRITTEN = [post for post in TABLE if "refused" not in post]
REFUSED = [post for post in TABLE if "refused" in post]
READ_BY_RS274 = [post for post in TABLE if isinstance(BY_RS274.get(post["file"]), list)]


def of_each(posts):
    return pytest.mark.parametrize("post", posts, ids=lambda post: post["file"])


def words_of_cell(post, folder):
    """Return the options that state the cell of a post."""
    if "cell" not in post:
        return ()
    lines = ['based_on = "demonstration"']
    for key, value in post["cell"].items():
        table = (
            "\n".join(f"{name} = {json.dumps(one)}" for name, one in value.items())
            if isinstance(value, dict)
            else ""
        )
        lines.append(f"[{key}]\n{table}" if table else f"{key} = {json.dumps(value)}")
    (folder / "cell.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return "--cell", "cell.toml"


def translated(run, post, *options):
    """Return exit code and record of the command on a post's program."""
    outcome = run(POSTS / post["file"], "-o", "part.src", "--json", *options)
    return outcome.code, json.loads(outcome.out)


def errors_of(record):
    return [issue for issue in record["issues"] if issue["severity"] == "error"]


def test_every_program_of_the_folder_stands_in_the_table():
    names = [post["file"] for post in TABLE]
    assert sorted(names) == sorted({path.name for path in POSTS.iterdir() if path.is_file()} - OWN_FILES)
    assert len(names) >= 20


@of_each(REMEDIED)
def test_what_is_missing_is_named_with_the_remedy(run, post):
    options = () if "cell" not in post else ("--dialect", post.get("dialect", "linuxcnc"))
    code, record = translated(run, post, *options)
    found = errors_of(record)
    assert code in (1, 2)
    assert sorted({issue["code"] for issue in found}) == sorted(post["first"]["codes"])
    assert all(issue["line"] for issue in found)
    assert any(post["first"]["remedy"] in issue["remedy"] for issue in found)


@of_each(WRITTEN)
def test_the_program_is_written_and_verified_once_the_remedy_is_followed(run, post, tmp_path):
    options = ("--dialect", post.get("dialect", "linuxcnc"), *words_of_cell(post, tmp_path))
    code, record = translated(run, post, *options)
    assert code == 0, errors_of(record)
    assert (tmp_path / "part.src").stat().st_size > 0
    assert record["verify"]["max_deviation_mm"] <= 0.001


@of_each(REFUSED)
def test_what_cannot_be_written_is_refused_with_a_remedy(run, post, tmp_path):
    code, record = translated(run, post, "--dialect", post.get("dialect", "linuxcnc"))
    found = errors_of(record)
    assert code in (1, 2)
    assert not list(tmp_path.glob("part.*"))
    assert {issue["code"] for issue in found} == set(post["refused"]["codes"])
    assert any(post["refused"]["remedy"] in issue["remedy"] for issue in found)


@of_each(WRITTEN)
def test_the_tip_stands_where_the_program_says(post):
    cell = over_demonstration(post.get("cell"))
    toolpath = read_gcode(POSTS / post["file"], cell, dialect=post.get("dialect", "linuxcnc"))
    for line, *tip in post["tips"]:
        row = np.flatnonzero(toolpath.source_line == line)[-1]
        np.testing.assert_allclose(toolpath.position_mm[row], tip, rtol=0, atol=1e-9, err_msg=f"line {line}")


@of_each(READ_BY_RS274)
def test_moves_end_where_linuxcnc_ends_them(post):
    toolpath = read_gcode(POSTS / post["file"], load_cell(), tools=POSTS / "tool.tbl")
    arc = toolpath.arc[1:]
    ends = np.append((arc[:-1] < 0) | (arc[:-1] != arc[1:]), True)
    rows = np.flatnonzero(ends) + 1
    kinds = np.where(toolpath.arc[rows] >= 0, "arc", np.where(toolpath.rapid[rows], "rapid", "feed"))
    moves = BY_RS274[post["file"]]
    assert kinds.tolist() == [kind for kind, *_ in moves]
    np.testing.assert_allclose(toolpath.position_mm[rows], [end for _, *end in moves], rtol=0, atol=1e-6)

"""What a person releases by hand: one finding, or all of a kind; the program's header says so."""

import pytest

from gcode2krl.errors import Issue, NotUnderstoodError, RefusedError
from gcode2krl.krl.release import header_words, matching, released
from tests.krl.conftest import PART

CLEAN = "G21 G90 G17\nT1 M6\nG0 G43 H1 Z50\nS12000 M3\nX0 Y0\nG1 Z-2 F600\nX50 F1500\nG0 Z50\nM5\nM30\n"
FOUND = (
    Issue("error", "spindle-off", 3, "feed with the spindle off", "M3"),
    Issue("error", "spindle-off", 9, "feed with the spindle off", "M3"),
    Issue("warning", "spindle-off", 11, "feed with the spindle off", "M3"),
    Issue("error", "out-of-reach", 9, "out of reach", "move the part"),
)


def severities(findings):
    return [issue.severity for issue in findings]


def test_one_line_or_the_whole_file():
    spindle = FOUND[:3]
    with pytest.raises(RefusedError):
        released(spindle, ["spindle-off:3"])
    done = released(spindle, ["spindle-off"])
    assert severities(done) == ["warning"] * 3
    assert [issue.message.endswith("(released by hand)") for issue in done] == [True, True, False]
    assert released(spindle, ["spindle-off", "spindle-off:3"]) == done


def test_what_is_never_released_is_not_released_for_a_whole_file():
    with pytest.raises(NotUnderstoodError, match="out-of-reach cannot be released"):
        released(FOUND, ["spindle-off", "out-of-reach"])


@pytest.mark.parametrize("word", ["spindle-on", "spindle-off:4", "spindle-off:11"])
def test_a_release_that_matches_no_error(word):
    with pytest.raises(NotUnderstoodError, match="no such finding"):
        released(FOUND[:3], [word])
    assert matching(FOUND, [word, "spindle-off"]) == ("spindle-off",)


@pytest.mark.parametrize(
    "word",
    ["", ":3", "spindle-off:", "spindle-off:x", "spindle off", "a:1:x", "a:b:1:2", "A\n; x", "a:b\n; x:1"],
)
def test_a_release_of_another_form(word):
    with pytest.raises(NotUnderstoodError, match="CODE:LINE or CODE"):
        released(FOUND, [word])


def test_the_header_counts_what_a_whole_file_released():
    words = header_words(FOUND, ["spindle-off", "spindle-off:9"])
    assert words == ("spindle-off (whole file, 2)", "spindle-off:9")


def test_a_program_with_all_of_a_kind_released(make):
    text = PART.replace("G1 X40 F1500", "G1 X40 F1500\nM77").replace("G1 Y25", "M77\nG1 Y25")
    with pytest.raises(RefusedError, match="m-code-unmapped"):
        make(text, allow=["m-code-unmapped:11"])
    made = make(text, allow=["m-code-unmapped"])
    head = made.src.read_text("ascii").split("DECL")[0]
    assert "; findings released by hand: m-code-unmapped (whole file, 2)\n" in head
    assert made.verified().ok


def test_on_the_command_line_releases_of_later_stages_are_no_slips(run, tmp_path):
    """The M-code is an error of reading, the rapid through the stock one of the forces."""
    part = tmp_path / "part.nc"
    part.write_text(CLEAN.replace("M5\n", "M88\nG0 Y30\nG0 Z-1\nG0 X5\nG0 Z20\nM5\n"), encoding="ascii")
    cell = tmp_path / "cell.toml"
    stock = "[stock]\nbox_mm = [[-10.0, -10.0, -20.0], [60.0, 60.0, 0.0]]\n"
    cell.write_text(f'based_on = "demonstration"\n{stock}', encoding="ascii")
    assert "[rapid-in-stock]" in run(part, "--cell", cell, "--allow", "m-code-unmapped", code=1).err
    run(
        part, "--cell", cell, "--allow", "m-code-unmapped", "--allow", "rapid-in-stock", "-o", "a.src", code=0
    )
    head = (tmp_path / "a.src").read_text(encoding="ascii")
    assert "m-code-unmapped (whole file, 1), rapid-in-stock (whole file, " in head

"""Many findings on a screen: one cause once, equal ones counted, consequences behind their cause."""

import pytest

from gcode2krl.codes import all_codes, follows
from gcode2krl.errors import MOST_LINES, MOST_PLACES, Issue, NotUnderstoodError, told


def _error(code: str, line: int, message: str = "wrong", remedy: str = "mend it") -> Issue:
    return Issue("error", code, line, message, remedy)


def test_a_single_finding_reads_as_before() -> None:
    issue = _error("spindle-off", 6, "feed move with the spindle off")
    assert told([issue]).lines("part.nc") == [issue.text("part.nc")]
    assert issue.text("part.nc") == (
        "part.nc:6: error: feed move with the spindle off [spindle-off] -> mend it"
    )


def test_equal_findings_are_one_line_with_the_first_lines_and_a_count() -> None:
    lines = [12, 15, 18, 21, *range(100, 2190)]
    found = told([_error("spindle-off", line, "off") for line in lines]).lines("p.nc")
    assert found == [
        "p.nc:12: error: off (also in lines 15, 18, 21 and at least 2,090 more) [spindle-off] -> mend it"
    ]
    few = told([_error("spindle-off", line, "off") for line in (12, 15, 18)]).lines("p.nc")
    assert few == ["p.nc:12: error: off (also in lines 15, 18) [spindle-off] -> mend it"]
    two = told([_error("spindle-off", line, "off") for line in (12, 15)]).lines()
    assert two == ["line 12: error: off (also in line 15) [spindle-off] -> mend it"]
    same = told([_error("bad-character", 4, "'$'")] * 3).lines("p.nc")
    assert same == ["p.nc:4: error: '$' (3 times) [bad-character] -> mend it"]


def test_the_first_of_equal_findings_quotes_its_line() -> None:
    issues = [Issue("error", "expression", k, "not read", "plain numbers", f"G1 X^#{k}") for k in (3, 9)]
    assert told(issues).lines("p.nc") == [
        "p.nc:3: error: not read, near `G1 X^#3` (also in line 9) [expression] -> plain numbers"
    ]


def test_a_few_figures_are_printed_apart_and_many_are_one_line() -> None:
    few = told([_error("tool-unknown", k, f"T{k} is not in the cell", f"add [tool.{k}]") for k in (1, 2, 7)])
    assert [finding.first.message for finding in few.findings] == [
        f"T{k} is not in the cell" for k in (1, 2, 7)
    ]
    many = told([_error("joint-limit", k, f"A6 at {k + 0.25} deg") for k in range(10, 40)]).lines("p.nc")
    assert many == [
        "p.nc:10: error: A6 at 10.25 deg (also with other figures in lines 11, 12, 13 and 26 more) "
        "[joint-limit] -> mend it"
    ]


def test_no_code_prints_more_than_eight_lines_and_the_rest_is_counted() -> None:
    words = "abcdefghijklmnop"
    shown = told([_error("cell-key", 0, f"key {word} is wrong") for word in words])
    assert len(shown.findings) == 8
    assert shown.counts() == (f"… and {len(words) - 8} more findings: cell-key {len(words) - 8}",)


def test_at_most_twenty_lines_and_errors_first() -> None:
    names = list(all_codes())[:30]
    issues = [Issue("note", name, 1, "a") for name in names] + [_error("template", 0, "broken")]
    shown = told(issues)
    assert shown.findings[0].first.code == "template"
    assert len(shown.findings) <= MOST_LINES
    assert sum(len(f.issues) for f in shown.findings) + len(shown.left_out) + len(shown.consequences) == 31


def test_consequences_are_counted_behind_their_cause() -> None:
    issues = [
        _error("no-feed", 20, "no feed"),
        _error("expression", 3, "not read"),
        *(_error("no-feed", line, "no feed") for line in range(21, 65)),
        _error("arc-radius-mismatch", 30, "radii"),
    ]
    assert told(issues).lines("cutout.ngc") == [
        "cutout.ngc:3: error: not read [expression] -> mend it",
        "… and 46 findings that follow from these: no-feed 45, arc-radius-mismatch 1",
    ]
    one = told([_error("expression", 3), _error("no-feed", 4)]).counts()
    assert one == ("… and 1 finding that follows from these: no-feed 1",)


def test_what_stands_before_a_cause_or_is_worse_is_no_consequence() -> None:
    earlier = told([_error("no-feed", 2), _error("expression", 3)])
    assert earlier.consequences == ()
    milder = [Issue("warning", "unit-doubtful", 0, "inches?"), _error("out-of-reach", 9)]
    assert told(milder).consequences == ()
    as_error = [_error("unit-doubtful", 0, "inches?"), _error("out-of-reach", 9)]
    assert [issue.code for issue in told(as_error).consequences] == ["out-of-reach"]


def test_causes_go_over_several_steps() -> None:
    assert "no-feed" in all_codes()["no-motion-mode"].follows
    assert "negative-feed" not in all_codes()["no-motion-mode"].follows
    assert "negative-feed" in follows("no-motion-mode")


@pytest.mark.parametrize("count", [1, 3, 40, MOST_PLACES + 1])
def test_nothing_gets_lost(count: int) -> None:
    issues = [_error(code, k) for k in range(count) for code in ("no-feed", "expression", "spindle-off")]
    shown = told(issues)
    listed = [issue for finding in shown.findings for issue in finding.issues]
    assert len(listed) + len(shown.left_out) + len(shown.consequences) == len(issues)


def test_an_exception_says_it_in_few_lines_and_carries_everything() -> None:
    issues = [_error("spindle-off", line, "feed move with the spindle off") for line in range(1, 2095)]
    error = NotUnderstoodError(issues, "part.nc")
    assert str(error).count("\n") == 0
    assert "2,090 more" in str(error)
    assert len(error.issues) == 2094


@pytest.mark.parametrize("code", all_codes())
def test_a_finding_without_a_remedy_of_its_own_takes_that_of_the_table(code: str) -> None:
    text = Issue("error", code, 3, "wrong").text("part.nc")
    _, arrow, remedy = text.partition(f"[{code}] -> ")
    assert arrow
    assert len(remedy) > 5
    assert not remedy.endswith((".", " "))
    assert Issue("error", code, 3, "wrong", "do this").text().endswith("-> do this")


def test_an_unknown_code_has_no_remedy() -> None:
    assert Issue("error", "no-such-code", 0, "wrong").text() == "error: wrong [no-such-code]"

"""A change of tools in which nobody changes the tool is refused: the robot would move with another length."""

import pytest

HEAD = "G21 G90 G17\n"
CUT = "S8000 M3\nG0 X0 Y0\nG43 H{0} Z30\nG1 Z-1 F600\nX20\nG0 Z30\nM5\n"
SILENT = "; tool {{ tool }}"


def program(*tools):
    return HEAD + "".join(f"T{tool} M6\n" + CUT.format(tool) for tool in tools) + "M30\n"


def silent(plan, tools, **cell):
    return [i for i in plan(program(*tools), cell).targets.issues if i.code == "tool-change-silent"]


@pytest.mark.parametrize(
    ("tools", "tool_change", "lines"),
    [
        ((1, 2), SILENT, [10]),
        ((2,), SILENT, [2]),
        ((1, 2, 1), SILENT, [10]),
        ((1, 2), "{% if tool == 1 %}HALT{% endif %}", [10]),
        ((1, 2), "$OUT[41]=TRUE", [10]),
        ((1, 2), "IF $IN[5] THEN\nHALT\nENDIF", [10]),
        ((1, 1), SILENT, []),
        ((1, 2), "HALT ; tool {{ tool }}", []),
        ((1, 2), "$OUT[41]=TRUE\nWAIT FOR $IN[41]", []),
        ((1, 2), "$OUT[41]=TRUE\nWAIT SEC 8.0", []),
    ],
)
def test_a_change_needs_somebody_who_changes(plan, tools, tool_change, lines):
    """Tool 1 is mounted in the demonstration cell."""
    found = silent(plan, tools, tool_change=tool_change)
    assert [(issue.severity, issue.line, issue.key) for issue in found] == [
        ("error", line, "tool_change") for line in lines
    ]


def test_a_subprogram_may_change_the_tool(plan):
    externals = {"externals": ["CHANGE(INT :IN)"]}
    assert silent(plan, (1, 2), tool_change="CHANGE({{ tool }})", program=externals) == []

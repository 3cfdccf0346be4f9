"""Cells from elsewhere: templates that never end, KRL after KRL, subprograms of the controller, pulses."""

import subprocess
import sys

import pytest

from gcode2krl import load_cell
from gcode2krl.cell.template_rules import problem
from gcode2krl.cell.templates import TemplateError, render
from gcode2krl.cli.cell_list import findings, to_confirm
from gcode2krl.errors import NotUnderstoodError

BASED = 'based_on = "demonstration"\n'
ENDLESS = """
from gcode2krl.cell.templates import TemplateError, render
try:
    print(render({template!r}, {{}}))
except TemplateError as error:
    print("refused:", error)
"""


@pytest.mark.parametrize("template", ["{{ 1 | round(300000000, 'floor') }}", "{{ 5 | round(-1000000000) }}"])
def test_rounding_ends(template):
    done = subprocess.run(
        [sys.executable, "-c", ENDLESS.format(template=template)],
        capture_output=True,
        text=True,
        timeout=20,
        check=True,
    )
    assert done.stdout.startswith("refused: round")


def test_rounding_rounds():
    assert (
        render("{{ 1.256 | round(2) }} {{ 7 | round(-1, 'ceil') }} {{ 2.5 | round | int }}", {})
        == "1.26 10.0 2"
    )


@pytest.mark.parametrize(
    "template",
    [
        "{{ " + " ~ ".join(["cell.note"] * 900) + " }}",
        "{% if 'zz' in cell.note %}{% endif %}",
        "{% for c in cell.note %}{% endfor %}",
        "{% for c in cell.list %}{% endfor %}",
        "{% for i in range(1001) %}{% endfor %}",
        "{{ text }}",
    ],
)
def test_long_texts_and_long_loops_are_refused(template):
    values = {"cell": {"note": "z" * 100_000, "list": tuple(range(5000))}, "text": "z" * 100_000}
    with pytest.raises(TemplateError, match=r"longer than|more than 1000 rounds"):
        render(template, values)


@pytest.mark.parametrize(
    "text",
    [
        "IF TRUE THEN PTP HOME\nENDIF",
        "IF $IN[1] THEN\nELSE LIN {X 1}\nENDIF",
        "LOOP LIN {X 1}\nEXIT\nENDLOOP",
        "IF TRUE THEN\nENDIF PTP HOME",
        "REPEAT\nUNTIL TRUE PTP HOME",
        "SWITCH X\nCASE 1 PTP HOME\nENDSWITCH",
        "FOR I=1 TO 3 LIN_REL {X 1}\nENDFOR",
        "FOR $ADVANCE=1 TO 5\nENDFOR",
        "FOR BASE_DATA[1].X=1 TO 100\nENDFOR",
        "WAIT FOR TRUE PTP HOME",
        "WAIT SEC 1 LIN {X 1}",
        "WAIT SEC 1 C_DIS",
        "$OUT[1]=TRUE LIN {X 0}",
        "x=1 ptp home",
        'MSG="a;b" PTP HOME',
        "E(PTP HOME)",
        "E($BASE=3)",
        "PULSE($OUT[N],TRUE,1)",
        "$OUT[9999]=TRUE",
        "$OUT[0]=TRUE",
    ],
)
def test_a_motion_behind_a_statement_is_seen(text):
    assert problem(text, ["E()"])


@pytest.mark.parametrize(
    "text",
    [
        "FOR I=1 TO 3\n$OUT[1]=TRUE\nWAIT SEC 0.1\nENDFOR",
        "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO E()",
        "SWITCH N\nCASE 1\n$OUT[8192]=TRUE\nDEFAULT\nHALT\nENDSWITCH",
        "PULSE($OUT[4],TRUE,0.5)",
        "E(#STOP)",
        "LINE=3",
        '$OUT[1]=TRUE ; then PTP "HOME"',
    ],
)
def test_plain_statements_pass(text):
    assert problem(text, ["E()"]) == ""


@pytest.mark.parametrize("name", ["BAS", "ptp", "RSI_MOVECORR", "IR_STOPM", "GK_PILOT", "SetVar", "IF"])
def test_no_subprogram_of_the_controller_is_declared(name, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(f'{BASED}[program]\nexternals = ["{name}(INT :IN)"]\n')
    with pytest.raises(NotUnderstoodError, match="a template may not call it"):
        load_cell(path)


def m_codes(tmp_path, text):
    path = tmp_path / "cell.toml"
    path.write_text(f"{BASED}[m_code]\n{text}\n")
    return load_cell(path)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("M8 = '{% if rpm > 5000 %}$OUT[7]=TRUE{% endif %}'\nM9 = \"$OUT[3]=FALSE\\n$OUT[4]=FALSE\"", "M9"),
        ("M5 = '{% if rpm %}$OUT[1]=FALSE{% endif %}'\nM4 = ''", "M5"),
        ("M8 = 'PULSE($OUT[7],FALSE,1)'\nM9 = \"$OUT[3]=FALSE\\n$OUT[4]=FALSE\"", "M9"),
    ],
)
def test_pairs_hold_at_every_speed_and_for_pulses(tmp_path, text, key):
    with pytest.raises(NotUnderstoodError, match=f"m_code.{key}"):
        m_codes(tmp_path, text)


def test_a_pulse_is_a_signal(tmp_path):
    with pytest.raises(NotUnderstoodError, match=r"\$OUT\[1\] has two meanings"):
        m_codes(tmp_path, "M8 = 'PULSE($OUT[1],TRUE,1)'\nM9 = '$OUT[3]=FALSE'\nM7 = ''")
    cell = m_codes(
        tmp_path, "M10 = '$OUT[9]=TRUE\\nPULSE($OUT[10],TRUE,1)\\n$ANOUT[3]=0.5'".replace("'", '"')
    )
    shown = {what: value for what, value, _ in to_confirm(cell)}
    assert shown["M10"] == "switches $OUT[9] on, $OUT[10] pulsed, $ANOUT[3]=0.5"
    assert not [issue for issue in findings(cell) if issue.severity == "error"]


def test_memory_of_a_parent_is_not_counted():
    common = str(__import__("pathlib").Path(__file__).parents[1] / "benchmarks")
    child = f"import sys; sys.path.insert(0, {common!r}); import fuzz; print(fuzz.peak_mb())"
    parent = (
        "import subprocess, sys; held = bytearray(700_000_000)\n"
        f"print(subprocess.run([sys.executable, '-c', {child!r}], capture_output=True, text=True).stdout)"
    )
    done = subprocess.run([sys.executable, "-c", parent], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 500.0


def test_the_dump_of_the_demonstration_is_a_cell_of_its_own(run, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(run("models", "show", "kr300_demonstration", code=0).out)
    run("models", "confirm", path, "--by", "A", "--yes", code=0)
    cell = load_cell(path)
    assert cell.is_confirmed
    assert not cell.taken_over
    without = {"verified": None, "defaults": (), "unconfirmed": None}
    assert cell.model_copy(update=without) == load_cell().model_copy(update=without)

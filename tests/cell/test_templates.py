"""No code, no files, no memory and no motion from a template of a cell, under every command."""

import time

import pytest

from gcode2krl import load_cell, predict
from gcode2krl.cell.krl_effect import effect_of
from gcode2krl.cell.template_rules import problem
from gcode2krl.cell.templates import TemplateError, render
from gcode2krl.errors import Gcode2KrlError, RefusedError
from gcode2krl.prediction import Prediction
from tests.cells import over_demonstration
from tests.krl.conftest import Made, verified

PART = (
    "G21 G90 G54\nT1 M6\nG43 H1\nS8000 M3\nG0 X0 Y0\nG0 Z20\nM8\nG1 Z-1 F600\nG1 X20\nG0 Z50\nM9\nM5\nM30\n"
)
CODE = [
    r"""{{ cell.parse_raw("cos\nsystem\n(S'touch x'\ntR.", proto="pickle", allow_pickle=True) }}""",
    "{{ cell.parse_file('part.nc') }}",
    "{{ cell.m_code.update({'M3': 'HALT'}) }}",
    "{{ cell.m_code.__setitem__('M3', 'HALT') }}",
    "{{ cell.__class__.__mro__ }}",
    "{{ cell.model_copy() }}",
    "{{ cell['__class__'] }}",
    "{{ ''.__class__ }}",
    "{{ 'x'.format(cell) }}",
    "{{ self.__init__ }}",
    "{{ range.__globals__ }}",
    "{% include 'head.src.j2' %}",
    "{% import 'head.src.j2' as x %}",
    "{% set x = 1 %}",
    "{% macro x() %}{% endmacro %}",
    "{{ cell }}",
    "{{ cell | attr('name') }}",
    "{{ cell | pprint }}",
    "{{ cell | tojson }}",
]
WORK = [
    "{{ 'x' * 3000000000 }}",
    "{{ 'x' * 3e9 }}",
    "{{ '%3000000000d' % 1 }}",
    "{{ '%.3000000000f' % 1 }}",
    "{{ '%*d' % (3000000000, 1) }}",
    "{{ 9 ** 9 ** 9 }}",
    "{{ (1,) * 3000000000 }}",
    "{% for i in range(3000000000) %}x{% endfor %}",
    "{% for i in range(1000) %}{% for j in range(1000) %}x{% endfor %}{% endfor %}",
    "{% for i in range(1000) %}" + "x" * 1000 + "{% endfor %}",
    "{{ 'x' | center(3000000000) }}",
    "{{ 'x' | indent(3000000000) }}",
    "{{ lipsum(3000000000) }}",
    "{{ " + "(" * 4000 + "1" + ")" * 4000 + " }}",
    "{{ " + "-" * 8000 + "1 }}",
    "x" * 100_000,
    "{{ 1 | decimals(3000000000) }}",
]
KRL = [
    "PTP {A1 0}", "LIN {X 0}", "LIN_REL {Z 5}", "PTP_REL {A1 1}", "CIRC {X 0},{X 1}", "SLIN XP1", "SPTP XP1",
    "SPLINE", "BAS (#PTP_DAT)", "BAS(#BASE,3)", "BAS (#TOOL,5 )", "BAS (#VEL_CP,2.0 )", "$BASE=$NULLFRAME",
    "$TOOL=$NULLFRAME", "$LOAD.M=1", "$LOAD={M 1}", "$VEL.CP=2", "$ACC.CP=9", "$APO.CDIS=50", "$ADVANCE=5",
    "$IPO_MODE=#TCP", "$ACT_BASE=3", "$ACT_TOOL=3", "$OV_PRO=100", "BASE_DATA[1]=$NULLFRAME",
    "TOOL_DATA[1].X=3", "LOAD_DATA[1].M=1", "GOTO X", "X:", "RETURN", "RESUME", "BRAKE", "EXIT",
    "INTERRUPT OFF 21", "INTERRUPT OFF", "INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO X()", "GK_MSG={NR 1}",
    "IF FALSE THEN", "ENDIF", "ENDLOOP", "ELSE", "WHILE TRUE", "DEF X( )", "END", "DECL INT X", "EXT X( )",
    "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $BASE=$NULLFRAME", "MOVE_HOME()", "X=MOVE_HOME()",
    "$OUT[5]=MOVE( )", "WAIT FOR MOVE( )", "PULSE($BASE,TRUE,1)", "RSI_OFF()", "$SEN_PINT[1]=3",
    "{{ '$OUT[5]=TRUE\r$BASE=$NULLFRAME' }}", "$OUT[5]=TRUE{{ '\x0b' }}$BASE=$NULLFRAME", ";FOLD x", "é",
    "$out[5]=true\n$base = $nullframe", "  $BASE  =$NULLFRAME", "PTP{A1 0}", "$OUT[5]=TRUE$ADVANCE=0",
    "WAIT SEC 1$BASE=$NULLFRAME", "$OUT[I]=TRUE",
]  # fmt: skip  # list of statements, kept compact
GOOD = [
    "$OUT[5]=TRUE",
    "$ANOUT[2]=0.5",
    "PULSE ($OUT[5],TRUE,0.5)",
    "WAIT SEC 1.0",
    "WAIT FOR $IN[5]",
    "HALT",
    "IF $IN[3]==TRUE THEN\n$OUT[5]=TRUE\nELSE\n$OUT[5]=FALSE\nENDIF",
    "VACUUM(TRUE)",
    "MY_FLAG=TRUE",
    "FOR I=1 TO 3\nWAIT SEC 0.1\nENDFOR",
    "LOOP\nEXIT\nENDLOOP",
    "; PTP {A1 0}",
    "$FLAG[3]=TRUE",
    'MY_TEXT[]="GOTO ; PTP"',
    "WHILE $IN[1]\nWAIT SEC 0.1\nENDWHILE",
    ";FOLD x\n$OUT[5]=TRUE\n;ENDFOLD",
    "{% for n in (5, 6) %}$OUT[{{ n }}]=TRUE\n{% endfor %}",
    "{% if rpm > 5 %}HALT{% endif %}",
]


def cell_with(tmp_path, template, code="M8"):
    path = tmp_path / "cell.toml"
    body = template.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    body = body.replace("\x0b", "\\u000b")
    off = [f"$OUT[{n}]=FALSE" for n in (3, 4, 5, 6)] + ["MY_FLAG=FALSE", "VACUUM(FALSE)"]
    pair = 'M9 = "' + "\\n".join(off) + '"\n'
    externals = 'externals = ["VACUUM(BOOL :IN)"]\n'
    text = f'based_on = "demonstration"\n[program]\n{externals}[m_code]\n{code} = "{body}"\n'
    path.write_text(text + (pair if code == "M8" else ""), encoding="utf-8")
    return path


@pytest.mark.parametrize("template", CODE)
def test_no_code_and_no_files_under_any_command(run, tmp_path, template):
    """Under translate, predict and verify, also through the cell in a prediction's folder."""
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    cell_with(tmp_path, template)
    done = run("translate", "part.nc", "--cell", "cell.toml", "-o", "out.src", "--no-forces", code=1)
    assert "m_code.M8 of the cell" in done.err
    assert "correct m_code.M8 in the cell file" in done.err
    (tmp_path / "out.src").write_text("DEF OUT( )\nEND\n", encoding="ascii")
    assert run("verify", "out.src", "part.nc", "--cell", "cell.toml").code == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cell.toml", "out.src", "part.nc"]
    assert load_cell().m_code["M3"] != "HALT"


def test_no_code_from_the_cell_in_a_predictions_folder(tmp_path, monkeypatch):
    from gcode2krl import write_krl

    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(PART, encoding="ascii")
    prediction = predict("part.nc", load_cell(cell_with(tmp_path, CODE[0])), forces=False)
    prediction.save("prediction")
    with pytest.raises(RefusedError, match=r"m_code\.M8"):
        write_krl(Prediction.load("prediction"), tmp_path / "out.src")
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("template", WORK)
def test_bounded_work(template):
    started = time.perf_counter()
    with pytest.raises(TemplateError):
        render(template, {"rpm": 1.0})
    assert time.perf_counter() - started < 5.0


@pytest.mark.parametrize("template", KRL)
def test_a_template_neither_moves_nor_jumps_nor_changes_settings(template):
    assert problem(render(template, {"rpm": 1.0}))


@pytest.mark.parametrize("template", ["LIN_REL {Z 5}", "$OUT[5]=TRUE{{ '\x0b' }}$BASE=$NULLFRAME", "é"])
def test_nothing_is_written_with_a_template_that_moves_or_sets(tmp_path, template):
    cell = load_cell(cell_with(tmp_path, template))
    with pytest.raises(RefusedError, match=r"m_code\.M8 of the cell") as error:
        Made(
            tmp_path, PART, data={"m_code": dict(cell.m_code), "program": {"externals": ["VACUUM(BOOL :IN)"]}}
        )
    assert all("m_code.M8" in issue.remedy for issue in error.value.issues if issue.code == "template")
    assert not list(tmp_path.glob("*.src"))


@pytest.mark.parametrize("template", GOOD)
def test_what_a_template_may_say(tmp_path, template):
    made_with = load_cell(cell_with(tmp_path, template))
    data = {"m_code": dict(made_with.m_code), "program": {"externals": ["VACUUM(BOOL :IN)"]}}
    assert Made(tmp_path, PART, data=data).program.report.ok


@pytest.mark.parametrize("where", ["prologue", "epilogue"])
def test_prologue_and_epilogue_are_judged_too(tmp_path, where):
    with pytest.raises(RefusedError, match=rf"program\.{where} of the cell"):
        Made(tmp_path, PART, data={"program": {where: "$BASE=$NULLFRAME"}})


def test_a_tool_change_is_judged_too(tmp_path):
    with pytest.raises(RefusedError, match="tool_change of the cell"):
        Made(tmp_path, PART, data={"tool_change": "PTP HOME"})


def test_a_condition_hides_nothing(tmp_path):
    """The text is judged as it is written, with the values of the program."""
    data = {"m_code": {"M3": "$OUT[1]=TRUE\n{% if rpm > 7999 %}\n$ADVANCE=0{% endif %}"}}
    with pytest.raises(RefusedError, match=r"m_code\.M3 .*\$ADVANCE"):
        Made(tmp_path, PART, data=data)


@pytest.mark.parametrize(
    "line", ["$BASE=$NULLFRAME", "$TOOL=$NULLFRAME", "$ADVANCE=0", "BAS (#BASE,3 )", "GOTO X"]
)
def test_verify_sees_a_setting_behind_the_first_motion(tmp_path, line):

    made = Made(tmp_path, PART)
    lines = made.src.read_text("ascii").splitlines()
    at = next(k for k, text in enumerate(lines) if text.startswith("$OUT[3]=TRUE"))
    made.src.write_text("\r\n".join([*lines[: at + 1], line, *lines[at + 1 :]]) + "\r\n", encoding="ascii")
    issues = verified(made.src, made.toolpath, made.cell).issues
    found = [issue for issue in issues if issue.code == "krl-setting-changed"]
    assert [issue.line for issue in found] == [at + 2]
    assert "m_code" in found[0].remedy


def test_a_template_sees_plain_values_and_what_is_not_stated_is_false():
    values = {"spindle": {"run_cw_output": 7, "at_speed_input": None}, "cell": {"tool": {"1": {"teeth": 3}}}}
    assert render("$OUT[{{ spindle.run_cw_output }}]=TRUE", values) == "$OUT[7]=TRUE"
    assert render("{% if spindle.at_speed_input %}A{% else %}B{% endif %}", values) == "B"
    assert render("{{ cell.tool[1].teeth }}", values) == "3"
    for template in (
        "{{ spindle.at_speed_input }}",
        "{{ spindle.at_speed_input + 1 }}",
        "{{ 'a' ~ spindle.at_speed_input }}",
    ):
        with pytest.raises(TemplateError, match=r"spindle\.at_speed_input is not stated"):
            render(template, values)


def test_the_default_cell_says_nothing_forbidden():
    cell = over_demonstration()
    for template in cell.templates().values():
        text = render(template, {"spindle": cell.spindle.model_dump(), "rpm": 1.0, "tool": 1, "line": 1})
        assert problem(text) == ""


def test_outputs_are_read_back():
    text = "$OUT[1]=TRUE\n$OUT[2]=TRUE\n$OUT[2]=FALSE\n"
    text += "IF $IN[1] THEN\n$OUT[1]=FALSE\n$OUT[3]=TRUE\nENDIF\nX=FALSE"
    assert effect_of(text).on() == {"$OUT[1]", "$OUT[3]"}
    assert effect_of(text).off() == {"$OUT[2]", "X"}


def test_the_comment_of_a_g_code_line_is_only_text(tmp_path):
    part = PART.replace("M8\n", "M10 (x;$BASE=$NULLFRAME)\n")
    data = {"m_code": {"M10": "; {{ text }}"}}
    try:
        made = Made(tmp_path, part, data=data)
    except Gcode2KrlError:
        return
    assert "\n$BASE=$NULLFRAME" not in made.src.read_text("ascii").replace("\r", "")

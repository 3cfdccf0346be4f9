"""``gcode2krl init``: cells from typed keys, from answers in a file and from a controller's archive."""

import json
import math
import tomllib

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from examples import make_cells
from gcode2krl import load_cell
from gcode2krl.cell import library
from gcode2krl.cell.setup.answers import completed, read_answers
from gcode2krl.cell.setup.cell_text import text_of_cell
from gcode2krl.cell.setup.controller import ArchivedController, read_controller
from gcode2krl.cell.setup.questions import GENERAL_QUESTIONS, TOOL_QUESTIONS
from gcode2krl.cli.init import SCHEMA
from gcode2krl.cli.init_dialogue import Stopped, ask, questions_text
from tests.cell.setup.synthetic_archive import config_dat, machine_dat, write_zip
from tests.cell.setup.typist import CLEAR, ENTER, keys
from tests.conftest import ROOT

FOLDER = ROOT / "examples" / "cells"
CELLS = sorted(FOLDER.glob("*.toml"))
NOBODY = ArchivedController(source="")
SIX = {"spindle_on_digital_output", "spindle_on_analog_output", "tool_magazine", "change_by_hand"}
SIX |= {"upright_without_rail", "upside_down"}
STRANGERS = ["spindle_on_digital_output", "spindle_on_analog_output", "tool_magazine"]
"""KR 16-2, KR 120 R2700-2 and KR 300 R2500."""


def typed(words, controller=NOBODY):
    """Return the answers of a person who types these keys."""
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        pipe.send_text("".join(words))
        return ask(controller)


def answers_of(name, controller=NOBODY):
    return read_answers(FOLDER / "answers" / f"{name}.toml", controller)


# --- the example cells -----------------------------------------------------------------------------------


def test_the_examples_are_what_init_writes(tmp_path):
    """Else run examples/make_cells.py."""
    assert {file.stem for file in CELLS} == SIX
    make_cells.make(tmp_path)
    for file in (*CELLS, FOLDER / SCHEMA):
        assert (tmp_path / file.name).read_bytes() == file.read_bytes(), file.name


@pytest.mark.parametrize("cell", CELLS, ids=lambda path: path.stem)
def test_an_example_leaves_only_confirmations_and_translates(run, cell):
    done = run("models", "check", cell, "--json")
    checked = json.loads(done.out)
    assert (done.code, checked["valid"], checked["verified"]) == (0, True, False)
    assert (checked["missing"], checked["taken_over"], checked["issues"]) == ([], [], [])
    assert not [row for row in checked["confirm"] if "MISSING" in row["value"]]
    assert "warning" not in run(FOLDER / "part.nc", "--cell", cell, "-o", "part.src", code=0).err


def test_the_spindles_are_switched_as_the_cells_say(run, tmp_path):
    texts = {}
    for name in sorted(SIX):
        assert run(FOLDER / "part.nc", "--cell", FOLDER / f"{name}.toml", "-o", "part.src").code == 0
        texts[name] = (tmp_path / "part.src").read_text(encoding="ascii")
    digital = texts["spindle_on_digital_output"]
    assert (
        "HALT ; set the drive of the spindle to 9000 rpm, then start\n$OUT[9]=TRUE\nWAIT SEC 4.0" in digital
    )
    assert "$ANOUT" not in digital
    analog = texts["spindle_on_analog_output"]
    assert "$ANOUT[1]=0.5000\n$OUT[11]=TRUE\nWAIT FOR $IN[17]" in analog
    assert "$OUT[11]=FALSE\n$OUT[12]=FALSE\nWAIT SEC 8.0" in analog
    assert "EXT MAGAZINE(INT :IN)" in texts["tool_magazine"]
    _, _, behind = texts["tool_magazine"].partition("MAGAZINE(1)\n")
    assert "BAS (#TOOL,5 )" in behind.partition("\nLIN")[0]
    assert "HALT ; change to tool 1 by hand, then start" in texts["change_by_hand"]
    assert "$ROBROOT" not in texts["upright_without_rail"]
    assert "GK_DIFF=GK_INV:$ROBROOT" in texts["upside_down"]


# --- the ways to answer ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if k else []) for k, name in enumerate(sorted(SIX))]
)
def test_keys_at_a_terminal_give_the_same_cell(name):
    given = answers_of(name)
    answers = completed(typed(keys(given)), NOBODY)
    assert text_of_cell(answers, NOBODY, SCHEMA) == (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def test_a_wrong_answer_is_asked_again():
    words = keys(answers_of("upside_down"))
    at = next(k for k, word in enumerate(words) if "-105" in word)
    again = [*words[:at], "0 -60 75" + ENTER + "\x15" + "0 -60 75 0 999 0" + ENTER, *words[at:]]
    assert typed(again)["home"] == [0.0, -60.0, 75.0, 0.0, -105.0, 0.0]


@pytest.mark.slow
def test_a_frame_may_be_pasted_as_the_controller_writes_it():
    words = keys(answers_of("upside_down"))
    at = next(k for k, word in enumerate(words) if "2600" in word)
    words[at] = "\x15{X 0.0,Y 0.0,Z 2600.000,A 0.0,B 0.0,C 1.800E+2}" + ENTER
    assert typed(words)["robroot"] == [0.0, 0.0, 2600.0, 0.0, 0.0, 180.0]


def test_without_a_terminal_and_without_answers_it_is_one_line(run, monkeypatch):
    done = run("init")
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1
    assert "no terminal" in done.err


def test_nothing_is_overwritten(run, tmp_path):
    answers = FOLDER / "answers" / "upside_down.toml"
    (tmp_path / "cell.toml").write_text("mine", encoding="ascii")
    refused = run("init", "--answers", answers)
    assert (refused.code, (tmp_path / "cell.toml").read_text()) == (2, "mine")
    assert "output-exists" in refused.err
    assert not (tmp_path / SCHEMA).exists()
    assert run("init", "--answers", answers, "--force").code == 0
    assert run("init", "second.toml", "--answers", answers).code == 0  # the schema is ours
    (tmp_path / SCHEMA).write_text("{}", encoding="ascii")
    assert "output-exists" in run("init", "third.toml", "--answers", answers).err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cell.toml", SCHEMA, "second.toml"]


def test_the_first_line_leads_editors_to_a_schema_that_is_there(run, tmp_path):
    assert run("init", "--answers", FOLDER / "answers" / "upside_down.toml").code == 0
    first = (tmp_path / "cell.toml").read_text(encoding="utf-8").split("\n")[0]
    schema = tmp_path / first.removeprefix("#:schema ")
    assert json.loads(schema.read_text(encoding="ascii"))["title"] == "gcode2krl cell file"
    assert schema.read_text(encoding="ascii") == run("models", "schema").out


@pytest.mark.parametrize(
    ("line", "changed", "words"),
    [
        (3, 'robot = "KR 61 HA"', ("KR 61 HA", "did you mean 'KR 60 HA'")),
        (3, "# no robot", ("robot: needs an answer",)),
        (6, "home = [0, -90, 90, 0, 0]", ("home: found", "6 numbers")),
        (7, "base_number = 40", ("allowed: 0 to 32",)),
        (9, "clearence_mm = 100", ("clearence_mm: there is no such question; did you mean clearance_mm?",)),
        (11, "tools_by = true", ("tools_by: found",)),
        (27, 'model = "flat 8"', ("tools.0.model: found 'flat 8'", "did you mean 'flat 8 z3'")),
        (26, "number = 0", ("tools.0.number: found 0",)),
    ],
)
def test_an_answer_that_is_wrong_is_named_with_its_line(run, tmp_path, line, changed, words):
    lines = (FOLDER / "answers" / "upside_down.toml").read_text(encoding="utf-8").split("\n")
    lines[line - 1] = changed
    (tmp_path / "answers.toml").write_text("\n".join(lines), encoding="utf-8")
    done = run("init", "--answers", "answers.toml", code=2)
    assert not (tmp_path / "cell.toml").exists()
    for word in words:
        assert word in done.err
    if "needs" not in words[0]:
        assert f"answers.toml:{line}: error" in done.err


def test_answers_that_contradict_each_other_write_nothing(run, tmp_path):
    text = (FOLDER / "answers" / "spindle_on_analog_output.toml").read_text(encoding="utf-8")
    (tmp_path / "answers.toml").write_text(
        text.replace("mist_output = 14", "mist_output = 11"), encoding="utf-8"
    )
    done = run("init", "--answers", "answers.toml")
    assert (done.code, "signal-twice" in done.err, (tmp_path / "cell.toml").exists()) == (1, True, False)


def test_what_nobody_answers_is_left_out_and_named(run, tmp_path):
    (tmp_path / "answers.toml").write_text(
        'robot = "KR 16-2"\nmounting = "floor"\ntools_by = "length"\nreference_axis = "+z"\n'
        'tool_change = "none"\nspindle_speed = "drive"\n[[tools]]\nnumber = 1\nmodel = "flat 6 z3"\n',
        encoding="ascii",
    )
    missing = json.loads(run("init", "--answers", "answers.toml", "--json").out)["missing"]
    assert {"frames.base", "home.q_deg", "clearance.z_mm", "frames.tool", "load.mass_kg"} <= set(missing)
    text = (tmp_path / "cell.toml").read_text(encoding="utf-8")
    stated = tomllib.loads(text)
    assert stated["home"] == {}
    assert set(stated["frames"]) == {"source", "sure"}
    assert "m_code" not in stated or stated["m_code"] == {}
    assert text.count("NOT ANSWERED") >= 7
    assert run(FOLDER / "part.nc", "--cell", "cell.toml", "-o", "part.src").code == 1


def test_limits_that_the_library_lacks_are_asked(run, tmp_path):
    text = (FOLDER / "answers" / "spindle_on_analog_output.toml").read_text(encoding="utf-8")
    text = text.replace('"KR 120 R2700-2"', '"KR 120 R2500 pro"')
    (tmp_path / "answers.toml").write_text(text, encoding="utf-8")
    done = run("init", "--answers", "answers.toml", "--json")
    assert json.loads(done.out)["missing"] == ["robot.limits.q_deg"]
    typed_limits = "limits_deg = [-185, 185, -140, -5, -120, 155, -350, 350, -125, 125, -350, 350]\n"
    (tmp_path / "answers.toml").write_text(typed_limits + text, encoding="utf-8")
    assert json.loads(run("init", "--answers", "answers.toml", "--json", "--force").out)["missing"] == []
    assert load_cell(tmp_path / "cell.toml").robot.limits.q_deg[1:3] == ((-140.0, -5.0), (-120.0, 155.0))


def test_the_printed_questions_are_all_and_their_examples_are_answers(run, tmp_path):
    text = run("init", "--questions").out
    assert text == questions_text()
    assert tomllib.loads(text) == {}
    uncommented = "\n".join(
        line.removeprefix("# ") for line in text.split("\n") if " = " in line or line.startswith("# [[")
    )
    (tmp_path / "answers.toml").write_text(uncommented, encoding="utf-8")
    given = read_answers(tmp_path / "answers.toml", NOBODY)
    assert {question.key for question in GENERAL_QUESTIONS} | {"tools"} == set(given)
    assert {question.key for question in TOOL_QUESTIONS} == set(given["tools"][0])


# --- the archive -----------------------------------------------------------------------------------------


def archive_of(path, name):
    """Write an archive of the controller that has an example cell."""
    cell, given = load_cell(FOLDER / f"{name}.toml"), answers_of(name)
    tools = [(tool["data"], f"T{tool['number']}", tool["frame"]) for tool in given["tools"] if "data" in tool]
    if "reference_frame" in given:
        tools = [(1, "Spindle", given["reference_frame"])]
    bases = [(given["base_number"] or 1, "Table", cell.frames.base)]
    config = config_dat(cell, tools, bases, [(tools[0][0], cell.load)], cell.robot.model)
    return write_zip(path, config, machine_dat(cell))


PROVENANCE = ("source", "sure", "trafo_source", "trafo_sure", "defaults")


def without_provenance(cell):
    """Return a cell as tables, without where its values come from."""

    def plain(value):
        if isinstance(value, dict):
            return {key: plain(one) for key, one in value.items() if key not in PROVENANCE}
        return value

    return plain(cell.model_dump())


def stated(cell, **keys):
    """Return a cell whose ``[controller]`` states more."""
    return cell.model_copy(update={"controller": cell.controller.model_copy(update=keys)})


OF_ARCHIVE = (
    "robot",
    "mounting",
    "robroot",
    "home",
    "base",
    "load_kg",
    "load_centre_mm",
    "load_inertia_kgm2",
)


@pytest.mark.parametrize("name", sorted(SIX))
def test_an_archive_is_read_back_to_the_same_cell(run, tmp_path, name):
    archive_of(tmp_path / "archive.zip", name)
    lines = (FOLDER / "answers" / f"{name}.toml").read_text(encoding="utf-8").split("\n")
    left = [line for line in lines if line.partition(" ")[0] not in (*OF_ARCHIVE, "reference_frame", "frame")]
    (tmp_path / "answers.toml").write_text("\n".join(left), encoding="utf-8")
    run("init", "--controller", "archive.zip", "--answers", "answers.toml", code=0)
    ours, theirs = load_cell(tmp_path / "cell.toml"), load_cell(FOLDER / f"{name}.toml")
    if name == "spindle_on_digital_output":  # its base has no number: the archive has no entry for it
        assert ours.frames.base is None
        return
    assert ours.robot.trafo_name == f"{theirs.robot.trafo_name} C4 FLR ZH02"
    assert ours.robot.drives.gear_ratio == pytest.approx([1798 / 7] * 6)
    of_theirs = {"trafo_name": theirs.robot.trafo_name, "drives": theirs.robot.drives}
    named = ours.model_copy(update={"robot": ours.robot.model_copy(update=of_theirs)})
    assert (ours.controller.kss, theirs.controller.kss) == ("8.3", None)  # the answers do not state it
    assert without_provenance(named) == without_provenance(stated(theirs, kss="8.3"))
    assert ours.robot.limits.source == "archive archive.zip, $SOFTN_END and $SOFTP_END"


@pytest.mark.slow
@pytest.mark.parametrize("name", STRANGERS)
def test_enter_accepts_what_the_archive_states(tmp_path, name):
    controller = read_controller(archive_of(tmp_path / "archive.zip", name))
    words = keys(answers_of(name), controller)
    assert words[1:5] == [ENTER] * 4  # robot, KSS, mounting, HOME
    answers = completed(typed(words, controller), controller)
    assert answers["robot"] == controller.model
    assert answers["home"] == list(controller.home_deg)


def test_an_archive_of_another_arm_is_refused(run, tmp_path):
    archive_of(tmp_path / "archive.zip", "tool_magazine")
    answers = FOLDER / "answers" / "upside_down.toml"
    done = run("init", "--controller", "archive.zip", "--answers", answers, code=2)
    assert "robot: found 'KR 60 HA', allowed: KR 300 R2500 ultra" in done.err


@pytest.mark.slow
def test_what_is_cleared_at_the_terminal_is_left_out(tmp_path):
    controller = read_controller(archive_of(tmp_path / "archive.zip", "tool_magazine"))
    words = keys(answers_of("tool_magazine"), controller)
    words[4] = "\x15" + ENTER
    assert "home" not in completed(typed(words, controller), controller)


def test_a_robot_that_is_not_in_the_library_comes_from_the_archive(run, tmp_path):
    name = "upright_without_rail"
    cell = load_cell(FOLDER / f"{name}.toml")
    longer = cell.robot.geometry.model_copy(update={"c3_mm": 1345.0})
    strange = cell.model_copy(update={"robot": cell.robot.model_copy(update={"geometry": longer})})
    config = config_dat(cell, [(1, "S", cell.frames.tool)], [(4, "B", cell.frames.base)], [(1, cell.load)])
    write_zip(tmp_path / "archive.zip", config, machine_dat(strange, "#KR240R3330 C4 FLR"))
    text = (FOLDER / "answers" / f"{name}.toml").read_text(encoding="utf-8")
    (tmp_path / "answers.toml").write_text(text.replace('"KR 240 R2900-2"', '"other"'), encoding="utf-8")
    run("init", "--controller", "archive.zip", "--answers", "answers.toml", code=0)
    robot = load_cell(tmp_path / "cell.toml").robot
    assert (robot.model, robot.trafo_name, robot.geometry.c3_mm) == ("", "KR240R3330 C4 FLR", 1345.0)
    assert robot.limits.q_deg == cell.robot.limits.q_deg
    assert robot.speeds.qd_deg_s == pytest.approx(cell.robot.speeds.qd_deg_s, abs=0.06)


# --- a robot that is not in the library -------------------------------------------------------------------

DATA_SHEET = """name = "Long arm"
robot = "other"
lengths_mm = [350.0, -145.0, 675.0, 1600.0, 1950.0, 215.0]
reach_mm = 3901.0
payload_kg = 120.0
limits_deg = [-150, 150, -130, 70, -105, 155, -350, 350, -122.5, 122.5, -350, 350]
mounting = "floor"
home = [0, -90, 90, 0, 0, 0]
base_number = 0
base = [2400, 0, 900, 0, 0, 0]
clearance_mm = 150
"""
MACHINE = """tools_by = "length"
reference_frame = [250, 0, 250, 0, -90, 0]
reference_length_mm = 100
reference_axis = "+z"
tool_change = "hand"
mounted_tool = 1
load_kg = 60.0
load_centre_mm = [100, 0, 180]
spindle_max_rpm = 18000
spindle_speed = "drive"
run_output = 11
start_s = 5.0
stop_s = 8.0
[[tools]]
number = 1
model = "flat 16 z3"
length_mm = 100

"""


PART = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X0 Y0\nG1 Z-1 F600\nG1 X20\nG0 Z30\nM5\nM30\n"
LONG_ARM = "KR 120 R3900 K"


def answers_file(folder, text=DATA_SHEET):
    (folder / "answers.toml").write_text(text + MACHINE, "utf-8")


def described(folder):
    """The arm of the data sheet as a URDF: its zeros, axes and limits are KUKA's."""
    lines = tomllib.loads(DATA_SHEET)
    a1, a2, c1, c2, c3, c4 = (mm / 1000.0 for mm in lines["lengths_mm"])
    links = ("base", "shoulder", "arm", "elbow", "forearm", "wrist", "hand", "flange")
    places = [(0, 0, 0), (a1, 0, c1), (c2, 0, 0), (0, 0, -a2), (c3, 0, 0), (0, 0, 0), (c4, 0, 0)]
    axes = ("0 0 -1", "0 1 0", "0 1 0", "-1 0 0", "0 1 0", "-1 0 0", "1 0 0")
    joints = []
    for k, (place, axis) in enumerate(zip(places, axes, strict=True)):
        low, high = (math.radians(deg) for deg in (*lines["limits_deg"], 0, 0)[2 * k : 2 * k + 2])
        joints.append(
            f'<joint name="a{k + 1}" type="{"revolute" if k < 6 else "fixed"}"><axis xyz="{axis}"/>'
            f'<origin xyz="{" ".join(map(str, place))}"/><parent link="{links[k]}"/>'
            f'<child link="{links[k + 1]}"/><limit lower="{low}" upper="{high}" velocity="1.8"/></joint>'
        )
    (folder / "arm.urdf").write_text(f'<robot name="{LONG_ARM}">{"".join(joints)}</robot>', "utf-8")


@pytest.mark.parametrize(
    ("of_file", "asked", "typed_in"),
    [(["--controller", "arm.urdf"], 37, 22), ([], 37, 26)],
    ids=["its URDF", "its data sheet"],
)
def test_an_arm_of_no_library_needs_two_commands(run, tmp_path, monkeypatch, of_file, asked, typed_in):
    """A KR 120 R3900 K, whose reach and payload are public: from its file or its lengths to a program.

    Counted are the questions that the dialogue asks, and those that Enter alone does not answer.
    """
    described(tmp_path)
    answers_file(tmp_path, DATA_SHEET + f'robot_name = "{LONG_ARM}"\n')
    controller = read_controller(tmp_path / "arm.urdf") if of_file else NOBODY
    words = keys(read_answers(tmp_path / "answers.toml", controller), controller)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        pipe.send_text("".join(words))
        done = run("init", *of_file)
    assert done.code == 0, done.err
    assert (len(words), sum(word != ENTER for word in words)) == (asked, typed_in)
    robot = load_cell(tmp_path / "cell.toml").robot
    assert (robot.title, robot.geometry.c3_mm, robot.payload.reach_mm) == (LONG_ARM, 1950.0, 3901.0)
    (tmp_path / "part.nc").write_text(PART, "utf-8")
    done = run("part.nc", "--cell", "cell.toml", "-o", "part.src", code=0)
    assert f"robot      {LONG_ARM}, status S" in done.out
    assert (tmp_path / "part.src").exists()


def test_an_arm_that_nobody_names_is_called_so(run, tmp_path):
    answers_file(tmp_path)
    assert run("init", "--answers", "answers.toml").code == 0
    assert load_cell(tmp_path / "cell.toml").robot.title == "unnamed robot"


def test_lengths_that_do_not_give_the_reach_are_refused(run, tmp_path):
    answers_file(tmp_path, DATA_SHEET.replace("1950.0", "1590.0"))
    assert "the lengths reach" in run("init", "--answers", "answers.toml", code=2).err
    assert not (tmp_path / "cell.toml").exists()


def test_a_robot_file_may_be_named(run, tmp_path):
    (tmp_path / "my.toml").write_text(
        (ROOT / "models" / "robots" / "kr_210_2.toml").read_text("utf-8"), "utf-8"
    )
    lines = [
        line
        for line in DATA_SHEET.splitlines()
        if not line.startswith(("lengths", "reach", "payload", "robot"))
    ]
    answers_file(tmp_path, 'robot = "my.toml"\n' + "\n".join(lines) + "\n")
    run("init", "--answers", "answers.toml", code=0)
    assert load_cell(tmp_path / "cell.toml").robot.model == "KR 210-2"


@pytest.mark.parametrize(
    ("asked", "offered"),
    [
        ("KR 120 R3900 K", []),
        ("KR 999 R2700", []),
        ("KR 300 R2500", ["KR 300 R2500 ultra"]),
        ("KR 210 R2700-3", ["KR 210 R2700 extra", "KR 210 R2700 prime", "KR 210 R2700-2"]),
        ("KR 61 HA", ["KR 60 HA"]),
    ],
)
def test_no_arm_of_another_reach_is_offered(asked, offered):
    remedy = library.robot_meant(asked, sorted(library.names("robots")))
    assert [name for name in sorted(library.names("robots")) if name in remedy] == offered


def test_back_and_a_draft(tmp_path):
    """`<` asks the question before again; Ctrl-C keeps the answers, which the next dialogue proposes."""
    with pytest.raises(Stopped) as stopped:
        typed(["First" + ENTER, "<" + ENTER, CLEAR + "Second" + ENTER, "\x03"])
    assert stopped.value.answers["name"] == "Second"
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        pipe.send_text(ENTER + "\x03")
        with pytest.raises(Stopped) as again:
            ask(NOBODY, stopped.value.answers)
    assert again.value.answers["name"] == "Second"

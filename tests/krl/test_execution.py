"""Programs as written are executed by the independent executor, and lead to the intended targets."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell, predict, read_gcode, set_targets, write_krl
from tests.cells import over_demonstration
from tests.conftest import EXAMPLES, ROOT
from tests.krl.execution import Environment, Message, Output, Step, execute, inverted, judge
from tests.krl.language import parse_program
from tests.krl.surroundings import environment_of, expected_flange

NEAR_MM, NEAR = 2e-3, 1e-5
"""The decimals of positions, and of angles at the length of a tool; entries of rotations."""
FOLDER = ROOT / "examples"
PROGRAMS = [
    *((part, None, {}) for part in EXAMPLES if part.stem != "raster_finish"),
    (FOLDER / "contour_arcs.nc", {"controller": {"circ": True}}, {}),
    (FOLDER / "contour_arcs.nc", {"controller": {"spline": True}}, {}),
    (FOLDER / "cam_style.nc", {"program": {"max_lines": 100}}, {}),
    (FOLDER / "cam_style.nc", {"program": {"max_lines": 100}}, {"split": "files"}),
    (FOLDER / "cells" / "part.nc", FOLDER / "cells" / "tool_magazine.toml", {"split": "files"}),
    (FOLDER / "cells" / "part.nc", FOLDER / "cells" / "upside_down.toml", {}),
    (FOLDER / "five_axis" / "five_axis.nc", FOLDER / "five_axis" / "cell.toml", {}),
    (FOLDER / "external" / "long_part.nc", FOLDER / "external" / "robot_on_rail.toml", {}),
    (ROOT / "tests/golden/programs/everything.nc", ROOT / "tests/golden/programs/everything.toml", {}),
]


def assert_leads_to_targets(written, cell, world: Environment):
    """Every target is passed in its order, at its speed and blending; arcs and splines by their ends."""
    targets = written.targets
    run = execute(parse_program(written.texts), world)
    assert run.ended == "end", run.ended
    row = 0
    for motion in run.motions:
        root = inverted(world.root(motion.external))
        if motion.kind == "CIRC":
            row = _end_of_arc(motion, cell, targets, row, root)
        if targets.home[row]:
            np.testing.assert_allclose(motion.q_deg, cell.home.q_deg, atol=1e-4)
        else:
            _assert_at(root @ motion.flange, expected_flange(cell, targets, row))
        assert motion.is_cp != targets.ptp[row]
        if motion.is_cp:
            assert motion.settings["$VEL.CP"] * 1000.0 == pytest.approx(targets.speed_mm_s[row], abs=1e-3)
        if motion.kind in ("LIN", "CIRC"):
            blend = motion.settings["$APO.CDIS"] if motion.blend else 0.0
            assert blend == pytest.approx(targets.cdis_mm[row], abs=1e-3)
        row += 1
    assert row == len(targets)
    return run


def _assert_at(flange, expected):
    away = np.abs(flange - expected)
    assert away[:3, 3].max() < NEAR_MM
    assert away[:3, :3].max() < NEAR


def _end_of_arc(motion, cell, targets, row, root):
    """Return the row that a CIRC from ``row`` on leads to; its auxiliary point is a row between."""
    has_via = False
    while np.abs(root @ motion.flange - expected_flange(cell, targets, row))[:3, 3].max() > NEAR_MM:
        has_via = has_via or np.abs(targets.position_mm[row] - motion.via[:3, 3]).max() < NEAR_MM
        row += 1
    assert has_via
    return row


@pytest.mark.parametrize(("part", "own", "options"), PROGRAMS)
def test_programs_lead_to_their_targets(part, own, options, tmp_path):
    cell = over_demonstration(own) if isinstance(own, dict) else load_cell(own)
    targets = set_targets(read_gcode(part, cell), cell)
    written = write_krl(targets, tmp_path / "PART.src", cell, **options)
    assert not options or len([name for name in written.texts if name.endswith(".src")]) > 1
    tools = sorted(set(targets.tool.tolist()))
    assert_leads_to_targets(written, cell, environment_of(cell, tools))


@pytest.mark.parametrize("form", ["index", "values"])
def test_programs_with_pilot_force_and_correction_lead_to_their_targets(form, tmp_path):
    cell = load_cell()
    prediction = predict(FOLDER / "test_piece.nc", cell)
    written = write_krl(prediction, tmp_path / "PART.src", pilot=form, online="A")
    ready = cell.online.link.ready_output
    world = environment_of(cell, on_wait=lambda controller, _: controller.outputs.update({ready: True}))
    run = assert_leads_to_targets(written, cell, world)
    rsi = [step.text.split(" ")[0] for step in run.of(Step) if step.kind == "rsi"]
    assert rsi == ["create", "on", "off", "delete"]
    triggers = [step for step in run.of(Step) if step.kind == "trigger"]
    assert len(triggers) >= written.pilot.knots > 0


def test_outputs_and_messages_stand_in_the_order_of_the_program(tmp_path):
    cell = load_cell(FOLDER / "cells" / "tool_magazine.toml")
    targets = set_targets(read_gcode(FOLDER / "cells" / "part.nc", cell), cell)
    program = parse_program(write_krl(targets, tmp_path / "PART.src", cell).texts)
    called = []
    world = environment_of(cell, sorted(set(targets.tool.tolist())))
    world = replace(world, externals={"MAGAZINE": lambda controller, tool: called.append(tool)})
    run = execute(program, world)
    assert run.ended == "end"
    assert called == [event.values["tool"] for event in targets.events if event.kind == "tool"]
    runs = [o.value for o in run.of(Output) if not o.analog and o.number == cell.spindle.run_cw_output]
    assert runs[0] is True
    assert runs[-1] is False
    assert "not verified" in run.of(Message)[0].text


# --- the judge sees what it is for -------------------------------------------------------------------------

GUARDED = """&ACCESS RVP
DEF PART( )
EXT OTHER( )
DECL KRLMSG_T GK_MSG
DECL KRLMSGPAR_T GK_PAR[3]
DECL KRLMSGOPT_T GK_OPT
DECL INT GK_HANDLE
BAS (#INITMOV,0 )
$BASE={X 1500.0,Y 0.0,Z 800.0,A 0.0,B 0.0,C 0.0}
$VEL.CP=0.1
PTP {X 0.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0,S 2,T 35}
OTHER( )
$BASE={X 1500.0,Y 0.0,Z 800.0,A 0.0,B 0.0,C 0.0}
$VEL.CP=0.1
GUARD
LIN {X 50.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0}
END
"""
GUARD = """WHILE ABS($POS_ACT.X)>0.1
GK_MSG={MODUL[] "PART",NR 1,MSG_TXT[] "The arm is elsewhere"}
GK_HANDLE=SET_KRLMSG(#QUIT,GK_MSG,GK_PAR[],GK_OPT)
HALT
ENDWHILE
"""


def _moved(controller):
    controller.jog(controller.q_deg + np.array([5.0, 0, 0, 0, 0, 0]))


def _slower(controller):
    controller.set("$ACC.CP", 0.1)


def _put_back(controller, halt):
    controller.jog(controller.intended_q_deg)


@pytest.mark.parametrize(
    ("guard", "other", "person", "reasons"),
    [
        ("", None, None, set()),
        ("", _moved, None, {"start"}),
        ("", _slower, None, {"$ACC.CP"}),
        (GUARD, _moved, _put_back, set()),
        (GUARD, _slower, None, {"$ACC.CP"}),
        ("PTP {X 0.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0,S 2,T 35}\n", _moved, None, set()),
        ("LIN {X 0.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0}\n", _moved, None, {"start"}),
    ],
)
def test_judge_tells_what_goes_wrong_unguarded(guard, other, person, reasons):
    program = parse_program({"PART.src": GUARDED.replace("GUARD\n", guard)})
    world = environment_of(load_cell())
    intended = execute(program, world)
    assert intended.ended == "end"
    acting = {"externals": {"OTHER": other}} if other else {}
    acting |= {"on_halt": person} if person else {}
    run = execute(program, replace(world, **acting))
    assert {reason for wrong in judge(run, intended) for reason in wrong.reasons} == reasons


def test_judge_compares_programs_that_return_by_ptp_only_where_one_was_moved():
    back = "IF ABS($POS_ACT.X)>0.1 THEN\nPTP {X 0.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0,S 2,T 35}\nENDIF\n"
    program = parse_program({"PART.src": GUARDED.replace("GUARD\n", back)})
    world = environment_of(load_cell())
    run = execute(program, replace(world, externals={"OTHER": _moved}))
    assert len(run.motions) == 3
    assert judge(run, execute(program, world)) == []

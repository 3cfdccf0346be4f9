"""Remedies of what is said of the pilot force and of the online compensation."""

from dataclasses import replace

import numpy as np

from gcode2krl import load_cell, write_krl
from tests.krl.conftest import read
from tests.krl.forces import moved, with_forces
from tests.krl.test_pilot_program import FOOT, HEAD, noisy, predicted, sawtooth
from tests.online.test_cli import STOCK
from tests.online.test_twin import SLOT
from tests.remedies.bench import BASE, WET, block, call, case, laid
from tests.remedies.cutting import STATED
from tests.remedies.krl import CARRIED_CUT, LINK, METAL, ONLINE

SHORT = "".join(f"G1 X{1.2 * k:.1f} Y{0.3 * (k % 2):.1f}\n" for k in range(1, 60))
LINE = "G1 Z-1 F600\nG1 X60\n"
STATE = laid(BASE, {"words": ONLINE, "cell.toml": METAL | LINK, "cut": CARRIED_CUT})
MORE = "G0 Z20\nM5\nT2 M6\nS8000 M3\nG43 H2\nG0 X10 Y10 Z20\nG1 Z-1 F300\nX30\nG0 Z20\nM5\nM30\n"
AGAIN = "G1 Z-1 F300\nX30 F600\nG0 Z20\n{}\nG0 X10 Y10 Z20\nG1 Z-1 F300\nX30 F600"
KNOWN = {"compliance": {"sensor_height_mm": 56.0, "virtual_joints": STATED}}
SIMULATE = "online simulate part.nc --cell cell.toml"


def forced(body, force, tolerance_N=None):
    prediction = predicted(body, {"pilot": {"tolerance_N": float(tolerance_N)}} if tolerance_N else None)
    return with_forces(prediction, force(prediction))


@call
def pilot(what, form, tolerance_N=None):
    """Write a program with a pilot force that was made up."""
    body, force = {
        "noise": (f"G1 Z-1 F1500\n{SHORT}", lambda p: noisy(p, 60.0)),
        "murmur": (f"G1 Z-1 F1500\n{SHORT}", lambda p: noisy(p, 12.0)),
        "at_once": (LINE, lambda p: np.full((len(p.motion), 3), 100.0)),
        "in_air": (LINE, lambda p: np.where(p.motion.position_mm[:, 2:] < 0.0, 100.0, 0.0) * np.ones(3)),
        "teeth": ("G1 Z-1 F600\nG1 X300 F1500\n", lambda p: sawtooth(p, 0.012, 2.4)),
    }[what]
    return write_krl(
        forced(body, force, tolerance_N), "part.src", pilot=None if form == "default" else form
    ).issues


@call
def moved_after(how):
    """Write a program whose targets were changed behind its prediction, or not."""
    made = forced(LINE, lambda p: noisy(p, 12.0))
    if how == "changed":
        far = np.array(made.targets.position_mm)
        far[made.targets.move >= 0, 0] *= 2.0
        made = replace(made, targets=replace(made.targets, position_mm=far))
    return write_krl(made, "part.src", pilot="index").issues


@call
def steps(dt_s):
    """Write a program whose force jumps, predicted at a sample time."""
    cell = load_cell()
    prediction = moved(read(HEAD + LINE + FOOT, cell), cell, float(dt_s))
    inside = np.abs(prediction.motion.position_mm[:, :1] - 30.0) < 10.0
    return write_krl(
        with_forces(prediction, inside * np.array([500.0, 0.0, 0.0])), "part.src", pilot="index"
    ).issues


def words(text):
    return {"words": text}


CASES = {
    # switching it in the program
    "online-tool": case({"tail": MORE, "m_code.M6": "HALT"}, {"tail": BASE["tail"]}),
    "online-home": case(
        {"cut": AGAIN.format("G28 X0 Y0")}, {"cut": AGAIN.format("G28 Z0")}, {"cut": CARRIED_CUT}
    ),
    "online-halt": case({"cut": AGAIN.format("M0")}, {"cut": AGAIN.format("")}, {"cut": CARRIED_CUT}),
    "online-nothing": case({"head": ("Z20\n", "Z150\n"), "cut": "", "tail": "M5\nM30\n"}, words(WET)),
    "online-pilot": case(
        {**words(ONLINE.replace("--pilot none", "--pilot index")), "pilot.index_variable": "MY_INDEX"},
        {"pilot.index_variable": "$SEN_PINT[1]"},
        words(ONLINE),
    ),
    "online-address": case({"online": None}, {"cell.toml": LINK}),
    "rsi-index": case(
        {
            **words(ONLINE.replace("--pilot none", "--pilot index")),
            "pilot.index_variable": "$SEN_PINT[21]",
            "controller.rsi": "3",
        },
        {"pilot.index_variable": "$SEN_PINT[3]"},
    ),
    # the pilot force
    "pilot-dense": case(
        words("call pilot noise index 1"), words("call pilot noise index 400"), words("call pilot noise none")
    ),
    "pilot-left-out": case(
        words("call pilot noise default"),
        words("call pilot noise default 400"),
        words("call pilot noise none"),
    ),
    "pilot-tolerance": case(
        words("call pilot murmur index"),
        words("call pilot murmur index 400"),
        words("call pilot murmur none"),
    ),
    "pilot-lead": case(words("call pilot at_once index"), words("call pilot in_air index")),
    "pilot-motion": case(words("call moved_after changed"), words("call moved_after no")),
    "pilot-cycle": case(words("call steps 0.004"), words("call steps 0.012")),
    # the twin
    "nothing-judged": case(
        {
            **words(SIMULATE),
            "cell.toml": {**KNOWN, "stock": {"box_mm": [[0.0, 0.0, -30.0], [80.0, 40.0, -20.0]]}},
        },
        {"stock.box_mm": block(80.0, 40.0)},
    ),
    "pilot-refused": case(
        {
            **words(SIMULATE + " --feed-scale 0.5"),
            "cell.toml": {**KNOWN, "stock": {"box_mm": block(80.0, 40.0)}},
        },
        words(SIMULATE),
    ),
    "pilot-wrong": case(
        {
            "words": "online simulate slot.nc --cell slot.toml --pilot-scale 1.6",
            "slot.nc": SLOT,
            "slot.toml": STOCK,
        },
        words("online simulate slot.nc --cell slot.toml"),
    ),
}

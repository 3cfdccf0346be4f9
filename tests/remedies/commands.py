"""Remedies of what is said of options, files, folders and the commands beside `translate`."""

import gzip
import io
import re
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from gcode2krl import load_cell
from gcode2krl.gcode.tool_table import tools_from_table
from gcode2krl.prediction.folder import UNFINISHED
from tests.cell.setup.synthetic_archive import config_dat, machine_dat, write_zip
from tests.cell.setup.test_urdf import file_of, stretched
from tests.conftest import ROOT
from tests.remedies.bench import BASE, DRY, PREDICT, block, call, case
from tests.test_external_axes import ON_TABLE, TABLE, TABLE_MACHINE

STATE = BASE
FAST = PREDICT + " --no-forces"
ANSWERS = (ROOT / "examples/cells/answers/upside_down.toml").read_text(encoding="utf-8")
PART = BASE["head"] + BASE["cut"] + BASE["tail"]
EFFECT = re.search(
    r"```python\n((?:(?!```).)*EFFECT = .*?)```", (ROOT / "docs/effects.md").read_text(encoding="utf-8"), re.S
)[1]
RAIL = {
    "kind": "rail",
    "axis": "y",
    "limits": [-500.0, 9500.0],
    "speed": 1200.0,
    "acceleration": 1500.0,
    "coupled": True,
}
FAR = "G1 Z-1 F300\nX30\nG0 Z20\nY7000\nG1 Z-1 F300\nX10"


TURNING = {
    "external": {"E1": TABLE | {"follows": "tool", "limits": [-90.0, 90.0]}},
    "machine": TABLE_MACHINE,
    "frames": {"base": ON_TABLE},
}
ROUND = "G0 Z40 A0 C0\nG43.4 H1\n" + "\n".join(
    f"G1 X{60 * np.cos(a):.4f} Y{60 * np.sin(a):.4f} Z5 A-20 C{-np.degrees(a) - 90:.4f} F2000"
    for a in np.linspace(0.0, 1.5 * np.pi, 60)
)
ARM = stretched((330.0, -115.0, 645.0, 1150.0, 1220.0, 215.0))


def xacro(joints):
    with tempfile.TemporaryDirectory() as folder:
        return file_of(Path(folder), joints).read_text(encoding="utf-8")


def archive():
    hanging = load_cell(ROOT / "examples" / "cells" / "upside_down.toml")
    with tempfile.TemporaryDirectory() as folder:
        return write_zip(Path(folder) / "a.zip", config_dat(hanging), machine_dat(hanging)).read_bytes()


ARCHIVE = archive()


@call
def tool_table():
    tools_from_table("tool.tbl")


@call
def figure(folder, name):
    from gcode2krl import Prediction
    from gcode2krl.figures import figure_of

    figure_of(Prediction.load(folder), name)


def parquet(content):
    """Return a table with a column of another name, as another program writes it."""
    written, table = io.BytesIO(), pq.read_table(io.BytesIO(content))
    pq.write_table(table.rename_columns(["a", *table.column_names[1:]]), written)
    return written.getvalue()


def damaged(file, edit):
    """Return the case of a prediction whose file was changed, and is made again."""
    return case(
        {"words": f"{FAST}; change; report prediction", "change": {file: edit}},
        {"words": f"{FAST}; change; {FAST}; report prediction"},
    )


CASES = {
    # options
    "option-value": case({"options": "--tolerance -1"}, {"options": "--tolerance 1"}),
    "command-unknown": case({"words": "predct part.nc"}, {"words": "predict part.nc --no-forces"}),
    "code-unknown": case({"words": "explain spindel-off"}, {"words": "explain spindle-off"}),
    "allow": case({"options": "--allow spindle-off:99"}, {"options": ""}),
    "dialect-unknown": case({"head": "$PART.MIN%\nG15 H1\n" + BASE["head"]}, {"head": BASE["head"]}),
    "output-unwritable": case(
        {"words": DRY.replace("out.src", "nowhere/out.src")}, {"nowhere/a.txt": ""}, {"words": DRY}
    ),
    "output-is-input": case(
        {"words": DRY.replace("part.nc", "out.dat"), "out.dat": PART},
        {"words": DRY.replace("part.nc", "out.dat").replace("out.src", "b.src")},
    ),
    "output-foreign": case({"words": FAST.replace("-o prediction", "-o .")}, {"words": FAST}),
    "output-exists": case(
        {"words": "init cell.toml --answers answers.toml", "answers.toml": ANSWERS},
        {"words": "init mine.toml --answers answers.toml"},
        {"words": "init cell.toml --answers answers.toml --force"},
    ),
    "init-answer": case(
        {"words": "init mine.toml --answers answers.toml", "answers.toml": ANSWERS.replace("KR ", "KX ")},
        {"answers.toml": ANSWERS},
    ),
    # files
    "file-unreadable": case({"words": DRY.replace("part.nc", "prat.nc")}, {"words": DRY}),
    "empty": case(
        {"head": "", "cut": "", "tail": ""}, {"head": BASE["head"], "cut": BASE["cut"], "tail": BASE["tail"]}
    ),
    "binary-file": case(
        {"words": DRY.replace("part.nc", "part.f3d"), "part.f3d": b"PK\0\1\2"}, {"words": DRY}
    ),
    "gzip-damaged": case(
        {"words": DRY.replace("part.nc", "p.nc.gz"), "p.nc.gz": gzip.compress(PART.encode(), mtime=0)[:-9]},
        {"p.nc.gz": gzip.compress(PART.encode(), mtime=0)},
    ),
    "line-ends": case(
        {"part.nc": PART.replace("\n", "\r")}, {"part.nc": PART}, {"part.nc": PART.replace("\n", "\r\n")}
    ),
    "not-a-part": case({"head": "G92 E0\nM104 S200\n" + BASE["head"]}, {"head": BASE["head"]}),
    "other-dialect": case(
        {
            "part.nc": "%_N_PART_MPF\nG71 G90 G17 G94\nT1 M6\nG54 D1\nS8000 M3\nG0 X10 Y10 Z20\nF300\n"
            "MCALL CYCLE81(10,0,2,-8)\nX20 Y10\nMCALL\nM30\n"
        },
        {"options": "--dialect sinumerik"},
    ),
    "more": case({"cut": "\n".join(f"G1 X{k} $" for k in range(1200))}, {"cut": "G1 Z-1 F300\nX30"}),
    "consequences": case({"cut": "G1 A3 F100\nG1 A4"}, {"cut": "G1 Z-1 F300\nX30"}),
    # a project
    "project-key": case(
        {"gcode2krl.toml": "simplfy = 0.01\n"},
        {"gcode2krl.toml": "simplify = 0.01\n"},
        {"options": "--isolated"},
    ),
    "project-options": case({"gcode2krl.toml": "tolerance = 0.05\n"}, {"options": "--isolated"}),
    "job-key": case(
        {"options": "--job job.toml", "job.toml": "[tool.1]\ndiameter_mm = 0\n"},
        {"job.toml": "[tool.1]\ndiameter_mm = 16.0\n"},
    ),
    # tools
    "tool-file": case(
        {"words": "tools import tool.tbl --cell cell.toml", "tool.tbl": "T77 P1 D6 ; 3 flute end mill\n"},
        {"options": "--unit mm --set 77.length_mm=90"},
        {"options": "--unit inch --set 77.length_mm=90"},
    ),
    "tool-table": case(
        {"tool.tbl": "P1 Z10 D6\n", "words": "call tool_table"}, {"tool.tbl": "T77 P1 Z10 D6\n"}
    ),
    # effects
    "effect-wrong": case(
        {"words": FAST + " --effect backlash:target=A9,gap_deg=0.02"},
        {"words": FAST + " --effect backlash:target=A2,gap_deg=0.02"},
    ),
    "effect-file": case(
        {"words": FAST + " --effects mine --effect sag:um_per_N=1", "mine/a.py": "x = 1\n"},
        {"mine/a.py": EFFECT},
    ),
    "effects-folder": case(
        {"words": FAST + " --effects mine/a.py --effect sag:um_per_N=1", "mine/a.py": EFFECT},
        {"words": FAST + " --effects mine --effect sag:um_per_N=1"},
    ),
    "effect-impossible": case({"words": FAST + " --effect other_program"}, {"words": FAST}),
    # a prediction's folder
    "prediction-unfinished": damaged("prediction/prediction.toml", UNFINISHED.decode()),
    "prediction-damaged": damaged("prediction/motion.parquet", lambda content: content[:-500]),
    "prediction-schema": damaged(
        "prediction/prediction.toml", ("gcode2krl/prediction/", "gcode2krl/prediction/0")
    ),
    "prediction-key": damaged("prediction/prediction.toml", ('severity = "note"', "severity = 3")),
    "prediction-empty": case(
        {"words": f"{FAST}; call figure prediction force"},
        {
            "words": f"{PREDICT}; call figure prediction force",
            "material.model": "AW-2017A",
            "stock.box_mm": block(40.0, 20.0),
        },
    ),
    # many parts
    "batch-table": case(
        {
            "words": "batch parts.toml -o out --no-forces --cell cell.toml",
            "a/p.nc": PART,
            "parts.toml": '[[folder]]\npath = "a"\ncel = "cell.toml"\n',
        },
        {"parts.toml": '[[folder]]\npath = "a"\ncell = "cell.toml"\n'},
    ),
    "runkit-program": case(
        {"words": f"{DRY}; runkit out.src -o kit --lift 50"},
        {"words": f"{DRY}; runkit out.src -o kit --lift 50 --cell cell.toml"},
    ),
    # external axes
    "external-speed": case(
        {"external.E1": {k: v for k, v in RAIL.items() if k not in ("speed", "acceleration")}, "cut": FAR},
        {"external.E1": RAIL},
    ),
    "external-uncoupled": case({"external.E1": RAIL | {"coupled": False}, "cut": FAR}, {"external.E1": RAIL}),
    "external-moves": case(
        {"words": f"{DRY}; runkit out.src -o kit --lift 50 --cell cell.toml", "external.E1": RAIL},
        {"external.E1": RAIL | {"position": 0.0}},
    ),
    "prediction-columns": damaged("prediction/motion.parquet", parquet),
    "external-limit": case(
        {"cell.toml": TURNING, "cut": ROUND},
        {"external.E1.limits": [-2000.0, 2000.0]},
        {"external.E1.follows": None, "external.E1.position": 0.0},
        then="collision",
    ),
    "urdf": case(
        {
            "words": "init mine.toml --controller arm.xacro --answers answers.toml",
            "arm.xacro": xacro(ARM[:5]),
            "answers.toml": ANSWERS,
        },
        {"arm.xacro": xacro(ARM)},
        then="init-answer",
    ),
    "archive": case(
        {
            "words": "init mine.toml --controller robot.zip --answers answers.toml",
            "robot.zip": ARCHIVE[:-60],
            "answers.toml": ANSWERS,
        },
        {"robot.zip": ARCHIVE},
        then="init-answer",
    ),
}

"""Remedies of what is said of a cut: force, deflection, stock, chatter, restart, compensation."""

import trimesh

from gcode2krl import cut, load_cell, plan_motion, read_gcode, set_targets
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.cutting import mean_force
from tests.remedies.bench import BASE, LIMITS_DEG, PREDICT, WET, block, call, case, laid
from tests.remedies.cell import OWN_ROBOT
from tests.remedies.program import FIVE, A

LIGHT = {"Ktc": 200.0, "Krc": 60.0, "Kac": 30.0, "Kte": 2.0, "Kre": 2.0, "Kae": 0.5}
STATE = laid(
    BASE,
    {
        "words": WET,
        "material.linear_edge": LIGHT,
        "stock.box_mm": block(80.0, 40.0),
        "stock.resolution_mm": 1.0,
    },
)
STEEL = {"Ktc": 2500.0, "Krc": 1000.0, "Kac": 500.0, "Kte": 40.0, "Kre": 40.0, "Kae": 5.0}


MEASURED = {"sure": "verified", "source": "a slot", "relative_band": 0.05}
ZERO = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
BLOCK = trimesh.creation.box(bounds=[[0, 0, -10], [80, 40, 0]])
BOX = BLOCK.export(file_type="stl")
SMALL = BLOCK.copy().apply_scale(1e-3).export(file_type="stl")
OPEN = trimesh.Trimesh(BLOCK.vertices, BLOCK.faces[:-1]).export(file_type="stl")
LOWER = trimesh.creation.box(bounds=[[0, 2, -10], [80, 18, -8]]).export(file_type="stl")


def all_joints(stiffness_Nmm_rad):
    return {name: dict.fromkeys(("k_c", "k_b", "k_a"), stiffness_Nmm_rad) for name in VIRTUAL_JOINTS}


STATED = all_joints(2e9)
LIMITED_ROBOT = OWN_ROBOT | {"limits": {"q_deg": LIMITS_DEG}}
DEEP = "G1 X-20 F3000\nZ-8\nX100 F1500"
SHALLOW = "G1 X-20 F3000\nZ-.3\nX100 F600"


@call
def force(a_p_mm):
    tool = load_cell().tool[1]
    mean_force([[0.0, 3.14]], [float(a_p_mm)], [0.1], tool.teeth, tool.diameter_mm, 0.0, list(LIGHT.values()))


@call
def cut_of():
    """Remove the material of the part in Python."""
    cell = load_cell("cell.toml")
    path = read_gcode("part.nc", cell)
    cut(path, plan_motion(set_targets(path, cell), cell), cell)


CASES = {
    "below-table": case({"cut": "G1 Z-80 F300"}, {"cut": "G1 Z-2 F300"}),
    "chip-thick": case(
        {"cut": "G1 Z-1 F300\nX70 F8000"},
        {"cut": "G1 Z-1 F300\nX70 F2000"},
        {"cut": "G1 Z-1 F300\nS18000\nX70 F8000"},
    ),
    "chip-thin": case({"cut": "G1 Z-1 F300\nS18000\nX70 F50"}, {"cut": "G1 Z-1 F600\nS18000\nX70 F3000"}),
    "deflection-high": case({"cut": DEEP, "material.linear_edge": STEEL}, {"cut": SHALLOW}, then="payload"),
    "depth-limit": case(
        {"cut": DEEP, "tool.1.max_depth_mm": 3.0}, {"cut": "G1 Z-2 F300\nX70 F900\nX10\nZ-4 F300\nX70 F900"}
    ),
    "drill-sideways": case(
        {"tool.1.kind": "drill", "tool.1.teeth": 2, "cut": DEEP},
        {"tool.1.kind": "flat"},
        {"cut": "G1 Z-8 F300"},
    ),
    "feed-per-tooth": case(
        {"head": ("S8000", "S80"), "cut": "G1 Z-1 F300\nX70 F1500"}, {"head": ("S80 ", "S8000 ")}
    ),
    "force-absurd": case(
        {
            "material.linear_edge": STEEL | {"Ktc": 29000.0, "Kte": 1900.0},
            "head": ("S8000", "S80"),
            "cut": DEEP,
        },
        {"material.linear_edge": LIGHT, "head": ("S80 ", "S8000 ")},
    ),
    "force-high": case({"cut": DEEP, "limits.force_N": 40.0}, {"cut": SHALLOW}, {"limits.force_N": 9000.0}),
    "force-limit": case({"cut": DEEP, "tool.1.max_force_N": 40.0}, {"cut": SHALLOW}),
    "force-unmeasured": case(
        {"cut": DEEP, "material.measured_f_z_mm": [0.1, 0.125]}, {"cut": "G1 X-20 F3000\nZ-8\nX100 F2700"}
    ),
    "holder-below-top": case(
        {"cut": "G1 Z-38 F300\nX70", "stock.box_mm": block(80.0, 40.0, -50.0), "tool.1.length_mm": 36.0},
        {
            "tool.1.stick_out_mm": 60.0,
            "tool.1.holder_diameter_mm": 40.0,
            "tool.1.length_mm": 120.0,
            "tool.1.flute_length_mm": 40.0,
        },
        {"tool.1.length_mm": 120.0},
        then="shank-in-stock",
    ),
    "holder-in-stock": case(
        {
            "cut": "G1 Z-30 F300\nX70",
            "stock.box_mm": block(80.0, 40.0, -50.0),
            "tool.1": {"stick_out_mm": 25.0, "holder_diameter_mm": 40.0, "flute_length_mm": 25.0},
        },
        {"tool.1.stick_out_mm": 40.0, "tool.1.flute_length_mm": 32.0},
        {"cut": "G1 Z-20 F300\nX70"},
    ),
    "shank-in-stock": case(
        {
            "cut": "G1 Z-40 F300\nX70",
            "stock.box_mm": block(80.0, 40.0, -50.0),
            "tool.1": {"flute_length_mm": 20.0, "stick_out_mm": 60.0, "holder_diameter_mm": 40.0},
        },
        {"tool.1.flute_length_mm": 45.0},
        {"cut": "G1 Z-18 F300\nX70"},
    ),
    "payload": case({"head": ("S8000", "S80"), "cut": DEEP}, {"head": ("S80 ", "S8000 ")}),
    "torque-high": case({"head": ("S8000", "S80"), "cut": DEEP}, {"head": ("S80 ", "S8000 ")}),
    "spindle-power": case({"cut": DEEP, "spindle.max_power_W": 100.0}, {"cut": SHALLOW}),
    "spindle-torque": case({"cut": DEEP, "spindle.max_torque_Nm": 0.2}, {"cut": SHALLOW}),
    "plunge": case(
        {"cut": "G1 Z-4 F300\nX70", "tool.1.centre_cutting": False},
        {"cut": "G1 Z0 F300\nX70 Z-4\nX10"},
        {"cut": "G1 X-20 F300\nZ-4\nX70"},
        {"tool.1.centre_cutting": True},
    ),
    "plunge-fast": case(
        {"cut": "G1 Z-4 F9000\nX70 F1500"},
        {"cut": "G1 Z-4 F300\nX70 F1500"},
        {"cut": "G1 Z0 F1500\nX70 Z-4\nX10"},
    ),
    "plunge-wide": case(
        {"cut": "G1 Z-2 F300\nX70", "tool.1.diameter_mm": 50.0},
        {"cut": "G1 X-40 F300\nZ-2\nX70"},
        {"cut": "G1 Z0 F300\nX70 Z-2"},
        {"tool.1.centre_cutting": True},
    ),
    "rapid-in-stock": case(
        {"cut": "G1 Z-4 F300\nX60\nG0 X20 Y30"},
        {"cut": "G1 Z-4 F300\nX60\nG0 Z5\nX20 Y30"},
        {"cut": "G1 Z-4 F300\nX60\nG1 X20 Y30"},
    ),
    "stock-guessed": case({"stock": None}, {"stock.box_mm": block(80.0, 40.0)}),
    "stock-large": case(
        {"stock.box_mm": block(5000.0, 5000.0), "stock.resolution_mm": None, "tool.1.diameter_mm": 0.5},
        {"stock.box_mm": block(80.0, 40.0)},
        {"stock.resolution_mm": 2.0},
    ),
    "stock-resolution": case(
        {"stock.resolution_mm": 0.01, "stock.box_mm": block(400.0, 400.0)},
        {"stock.resolution_mm": 1.0},
        {"stock.box_mm": [[9.0, 9.0, -10.0], [20.0, 20.0, 0.0]]},
    ),
    "stock-underside": case(
        {"cut": "G1 Z-10.4 F300\nX70"}, {"cut": "G1 Z-9 F300\nX70"}, {"stock.through_mm": 0.5}
    ),
    "stock-untouched": case(
        {"stock.box_mm": [[200.0, 200.0, -10.0], [280.0, 240.0, 0.0]]}, {"stock.box_mm": block(80.0, 40.0)}
    ),
    "no-deflection": case(
        {"words": WET + " --compensate offline --no-forces"},
        {"words": WET + " --compensate offline"},
        then=("compensation-unsure", "compensation-large"),
    ),
    "compensation-twice": case(
        {"words": WET + " --compensate offline --online RSI", "online.link.address": "192.168.7.3"},
        {"words": WET + " --online RSI"},
        {"words": WET + " --compensate offline"},
        then=("compensation-unsure", "compensation-large"),
    ),
    "compensation-unsure": case(
        {"words": WET + " --compensate offline", "cut": SHALLOW},
        {
            "compliance.sensor_height_mm": 56.0,
            "compliance.virtual_joints": STATED,
            "material.sure": "verified",
            "material.source": "a slot",
            "material.relative_band": 0.05,
        },
    ),
    "stiffness-estimated": case(
        {}, {"compliance.sensor_height_mm": 56.0, "compliance.virtual_joints": STATED}
    ),
    "stiffness-unknown": case(
        {"robot": LIMITED_ROBOT}, {"robot.payload.mass_kg": 120.0, "robot.payload.reach_mm": 2701.0}
    ),
    "near-mode": case(
        {"head": ("S8000", "S1200"), "cut": "G1 Z-1 F100\nX70", "compliance.modes_hz": [20.0]},
        {"head": ("S1200", "S1500")},
    ),
    # going on in the middle
    "restart-line": case({"words": WET + " --from-line 3"}, {"words": WET + " --from-line 7"}),
    "restart-stock-unknown": case(
        {"words": WET + " --from-line 8", "material": None}, {"material.model": "AW-2017A"}
    ),
    "restart-in-stock": case(
        {"words": WET + " --from-line 11", "cut": "G64 P3\nG1 Z-5 F300\nX60 F600\nY30\nX20"},
        {"words": WET + " --from-line 6"},
    ),
    "restart-line-before": case(
        {"words": WET + " --from-line 11", "cut": "G64 P3\nG1 X-20 F3000\nZ-5\nX60 F600\nY30\nX20"},
        {"cut": "G64 P0.01\nG1 X-20 F3000\nZ-5\nX60 F600\nY30\nX20"},
    ),
    "circ-left-out": case(
        {
            "words": WET.replace("--pilot none", "--pilot index"),
            "cut": "G1 Z0.5 F300\nZ-1\nG2 X50 Y10 I20",
            "controller.circ": True,
        },
        {"controller.circ": False},
        {"words": WET},
    ),
    "deflection-absurd": case(
        {"cut": DEEP, "compliance.sensor_height_mm": 56.0, "compliance.virtual_joints": all_joints(1e6)},
        {"compliance.virtual_joints": STATED},
    ),
    "effect-weightless": case(
        {
            "words": PREDICT + " --effect gear_twist:target=A2,deg_per_kNm=0.01",
            "robot.model": "KR 60 HA",
            "frames.base.x_mm": 1300.0,
            "frames.base.z_mm": 500.0,
            "load.mass_kg": 24.0,
        },
        {"robot.drives.link_mass_kg": [100.0, 80.0, 60.0, 20.0, 10.0, 3.0]},
    ),
    "lobes": case(
        {
            "cut": DEEP,
            "compliance.tap_modes": [
                {"tool": 1, "direction": x, "frequency_hz": 600.0, "damping": 0.02, "stiffness_N_mm": 300.0}
                for x in "xy"
            ],
        },
        {"cut": SHALLOW},
    ),
    "mode-coupling": case(
        {
            "cut": "G1 X-20 F3000\nZ-8\nX100 F1500",
            "material.linear_edge": {
                "Ktc": 1500.0,
                "Krc": 600.0,
                "Kac": 300.0,
                "Kte": 20.0,
                "Kre": 20.0,
                "Kae": 3.0,
            },
        },
        {"cut": SHALLOW},
        then="payload",
    ),
    "job-stock": case(
        {
            "words": WET + " --job job.toml",
            "job.toml": '[stock]\nmesh = "box.stl"\n',
            "box.stl": BOX,
            "work_offsets.G54": ZERO | {"x_mm": 5.0},
        },
        {"work_offsets.G54": ZERO},
        {"job.toml": "", "stock.box_mm": block(80.0, 40.0)},
    ),
    "stock-mesh": case({"box.stl": OPEN, "stock.mesh": "box.stl", "stock.box_mm": None}, {"box.stl": BOX}),
    "stock-unit": case({"box.stl": SMALL, "stock.mesh": "box.stl", "stock.box_mm": None}, {"box.stl": BOX}),
    "nominal-gouge": case(
        {
            "words": PREDICT + " --nominal part.stl",
            "part.stl": BOX,
            "cut": DEEP,
            "stock.box_mm": [[0.0, 2.0, -10.0], [80.0, 18.0, 0.0]],
            "stock.resolution_mm": 0.5,
        },
        {"cut": "G1 X-20 F3000\nZ-.05\nX100"},
        {"part.stl": LOWER},
    ),
    "nominal-rest": case(
        {
            "words": PREDICT + " --nominal part.stl",
            "part.stl": LOWER,
            "cut": SHALLOW,
            "stock.box_mm": [[0.0, 2.0, -10.0], [80.0, 18.0, 0.0]],
            "stock.resolution_mm": 0.5,
        },
        {"cut": DEEP},
    ),
    "restart-axis": case(
        {
            "cell.toml": FIVE,
            "words": WET + " --from-line 12",
            "cut": A + "G0 A0 C0\nG1 X20 Y10 Z50 F600\nG1 X21 A70 F600\nG1 X25\nG1 X30 A0\nX40",
        },
        {"words": WET + " --from-line 9"},
        then="restart-stock-unknown",
    ),
    "restart-arm": case(
        {
            "frames.spin": "auto",
            "words": WET + " --from-line 10",
            "head": ("X10 Y10", "X-700 Y0"),
            "cut": "G1 Z-1 F300\nX-690\nG0 Z5\nX-20 Y10\nG1 Z-1 F300\nX60 F600",
        },
        {"frames.spin": 90.0},
    ),
    "compensation-large": case(
        {
            "words": WET + " --compensate offline",
            "cut": DEEP,
            "compliance.sensor_height_mm": 56.0,
            "compliance.virtual_joints": all_joints(3e7),
            "material": MEASURED,
        },
        {"compliance.virtual_joints": STATED},
        {"cut": SHALLOW, "compliance.virtual_joints": STATED},
        then="compensation-unsettled",
    ),
    "axis-turns": case(
        {
            "words": WET + " --compensate offline",
            "cut": A + "G0 A0 C0\nG1 X20 Y10 Z-1 F600\nG1 A20\nG1 X40\nG0 Z80\nA0",
            "compliance.sensor_height_mm": 56.0,
            "compliance.virtual_joints": STATED,
            "material": MEASURED,
            "controller.vel_ori_deg_s": 10.0,
            **FIVE,
        },
        {"cut": A + "G0 A0 C0\nG1 X20 Y10 Z-1 F600\nG1 X40 A20\nG0 Z80\nA0"},
        {"cut": A + "G0 A0 C0\nG1 X20 Y10 Z-1 F600\nG0 Z80\nA20\nG1 Z-1 F600\nG1 X40\nG0 Z80\nA0"},
        says="on the spot",
    ),
    "compensation-rest": case(
        {
            "words": WET + " --compensate offline",
            "cut": "G1 Z-1 F300\nX60 F600",
            "compliance.sensor_height_mm": 56.0,
            "compliance.virtual_joints": STATED,
            "material": MEASURED,
        },
        {"cut": "G1 X-20 F3000\nZ-1\nX100 F600"},
    ),
    "force-input": case({"words": "call force -1"}, {"words": "call force 1"}),
    "material-missing": case({"words": "call cut_of", "material": None}, {"material.model": "AW-2017A"}),
}

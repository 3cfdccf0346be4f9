"""Everything besides a diagnosis: programs, predictions and identified cells of the examples, by one code."""

import hashlib
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_identity_run import called, where_from

ROOT = Path(__file__).resolve().parents[1]
PLANT = "plant.toml"
"""Cell of the independent plant, a KR 300 unlike the built-in one in stock and tool."""
EFFECTS = """
absolute_accuracy:a1_deg=0.02,a2_deg=0.02,a3_deg=0.02,a4_deg=0.02,a5_deg=0.02,a6_deg=0.02
advance_stop:count=3,hold_s=0.1
axis_coupling:ratio=0.001,deg_per_kNm=0.01
axis_parallelism:target=A3,mrad=0.2
backlash:target=A2,gap_deg=0.01
base_frame:x_mm=0.5,y_mm=0.5,z_mm=0.5,a_deg=0.02,b_deg=0.02,c_deg=0.02
base_number:x_mm=10,y_mm=10,z_mm=10,a_deg=1,b_deg=1,c_deg=1
bearing_wobble:target=A1,amplitude_mrad=0.05,per_turn=8,phase=0.5
belt_wind_up:target=A5,deg_per_kNm=0.1,relax_s=5
bolt_ratchet:target=tip,step_mm=0.01,threshold_N=50,direction_x=0,direction_y=0,direction_z=1
cable_pull:target=A1,N_per_deg=0.5,direction_x=0,direction_y=0,direction_z=1
clock:target=force,offset_s=0.01,skew=0.0001
collision:at_s=10,size_N=500,lasts_s=0.06,direction_x=1,direction_y=0,direction_z=0
corner:cdis_mm=1
current_limit:target=A1,limit_deg_s2=30,k_v_per_s=30
cutter_bending:um_per_N=0.2
dead_time:target=all,delay_s=0.01
edge_force:scale=1.5
encoder_interpolation:target=A2,amplitude_deg=0.0002,periods=512,phase=0
fixture_compliance:x_um_per_N=0.1,y_um_per_N=0.1,z_um_per_N=0.1
floor_vibration:target=z,hz=15,amplitude_mm=0.02,phase=0.5
force_delay:delay_s=0.02
force_drift:N_per_h=5,direction_x=0,direction_y=0,direction_z=1
force_hysteresis:loss_percent=1
force_offset:fx_N=10,fy_N=10,fz_N=10
force_scale:target=radial,scale=1.2
force_steps:step_N=5
friction:target=A2,spike_deg=0.01,decay_s=0.15
gear_twist:target=A2,deg_per_kNm=0.02
gravity:payload_kg=10,cx_mm=0,cy_mm=0,cz_mm=200
hose_pack:h0_N=10/10/10,H_xy_N_rad=20,H_zz_N_rad=20
hysteresis:target=A2,loss_deg=0.01
jerk_feed_forward:target=all,per_jerk_s3=-0.000001,settle_s=0.01
joint_eccentricity:target=A2,amplitude_deg=0.01,phase=0.5
link_length:target=a2,mm=0.5
load:mass_kg=30,dx_mm=0,dy_mm=0,dz_mm=0
mastering:target=A2,offset_deg=0.02
nonlinear_stiffness:target=A2,soft_deg=0.01,torque_Nm=100
override:percent=50
pedestal_compliance:x_mrad_per_kNm=0.02,y_mrad_per_kNm=0.02,foot_mm=0
rsi_on:gain=1,delay_s=0.1
runout:runout_mm=0.02,angle_deg=30
servo_gain:target=all,missing_share=0.3,k_v_per_s=30
servo_lag:target=A2,tau_s=0.01
spindle_droop:percent_per_Nm=1
spindle_growth:um_per_krpm=2,time_constant_s=60
step:target=tip,at_s=10,size_mm=0.1,direction_x=0,direction_y=0,direction_z=1
stiffness:target=A2,scale=0.8
stock_offset:target=y,offset_mm=0.5
swapped_tool:diameter_mm=2,length_mm=5
thermal:mm_per_h=0.2,time_constant_h=1,direction_x=0,direction_y=0,direction_z=1
tool_diameter:offset_mm=0.05
tool_frame:x_mm=0.3,y_mm=0.3,z_mm=0.3,a_deg=0.05,b_deg=0.05,c_deg=0.05
tool_number:target=2
tool_wear:growth_per_m=0.05
tool_weight:weight_N=20
tracker_drift:mm_per_h=0.03,direction_x=0,direction_y=0,direction_z=1
tracker_filter:tau_s=0.01
tracker_refraction:K_per_m=1,tracker_x_m=5,tracker_y_m=0
transmission:target=A2,amplitude_deg=0.004,harmonic=1,phase=0.5
unit:target=force,factor=1000
velocity_rule:k_s=0.2,acc_cp_m_s2=1.5
vibration:hz=12,damping=0.03,participation=0.5,direction_x=0,direction_y=0,direction_z=1
wrist_coupling:ratio=0.001
"""
"""Every effect that can be predicted, at a typical size."""

OPTIONS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("contour_arcs", ("--compensate", "offline")),
    ("test_piece", ("--compensate", "offline")),
    ("test_piece", ("--pilot", "values")),
    ("test_piece", ("--online", "PIECE")),
    ("test_piece", ("--split", "files", "--max-lines", "100")),
    ("test_piece", ("--tolerance", "0.05", "--comment-every", "1")),
)
"""Options of a translation; the test piece does not settle with the first one, and is refused."""


@dataclass(frozen=True)
class Call:
    """A call of the command line in a folder that holds the examples; ``{out}`` is its output folder."""

    name: str
    words: tuple[str, ...]


def calls() -> Iterator[Call]:
    """Yield the calls: each example by two cells, options, effects, identification, the online twin."""
    for part in sorted((ROOT / "examples").glob("*.nc")):
        name, words = part.stem, (f"examples/{part.name}", "--json")
        src = ("-o", f"{{out}}/{name}.src")
        yield Call(f"{name}-translate", ("translate", *words, *src))
        yield Call(f"{name}-predict", ("predict", *words, "-o", "{out}/prediction"))
        yield Call(f"{name}-plant", ("translate", *words, *src, "--cell", PLANT, "--no-forces"))
    own = ("everything.nc", "--cell", "everything.toml", "--json")
    yield Call("everything-translate", ("translate", *own, "-o", "{out}/everything.src"))
    for part_name, words in OPTIONS:
        yield Call(
            f"{part_name}{''.join(words[:2])}",
            ("translate", f"examples/{part_name}.nc", "--json", "-o", "{out}/part.src", *words),
        )
    for effect in EFFECTS.split():
        words = ("predict", "examples/test_piece.nc", "--json", "-o", "{out}/prediction", "--effect", effect)
        yield Call(f"effect-{effect.partition(':')[0]}", words)
    for name in ("robot", "holder"):
        yield Call(f"identify-{name}", ("identify", "stiffness", f"examples/identify/{name}.toml", "--json"))
    yield Call("identify-sensor", ("identify", "sensor", "examples/identify/orientations.csv", "--json"))
    yield Call("make-test", ("make-test", "controller", "-o", "{out}/test.src", "--json"))
    yield Call("online", ("online", "simulate", "--json"))


def programs(out: Path, only: str) -> int:
    """Write what every call writes and prints into a folder of its own; returns the exit code."""
    out = out.resolve()
    print(where_from(), file=sys.stderr)
    for call in calls():
        if only not in call.name:
            continue
        place = out / call.name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        with tempfile.TemporaryDirectory() as scratch:
            _laid_out(Path(scratch))
            before = Path.cwd()
            os.chdir(scratch)
            try:
                text = called([word.replace("{out}", "out") for word in call.words])
            finally:
                os.chdir(before)
            (place / "stdout.txt").write_text(text, encoding="utf-8", newline="\n")
            _kept(Path(scratch) / "out", place)
        failed = text.startswith("exit code") or "\nexit code" in text
        print(f"{call.name}{' refused' if failed else ''}", file=sys.stderr, flush=True)
    return 0


def _laid_out(folder: Path) -> None:
    """Copy the inputs to where every tree finds them by the same relative names."""
    shutil.copytree(ROOT / "examples", folder / "examples")
    for file in (ROOT / "tests" / "golden" / "programs").iterdir():
        shutil.copy(file, folder)
    (folder / PLANT).write_text(_plant_cell(), encoding="utf-8", newline="\n")
    (folder / "out").mkdir()


def _plant_cell() -> str:
    sys.path.insert(0, str(ROOT))
    from tests.plant.scene import CELL_TOML

    sys.path.remove(str(ROOT))
    return CELL_TOML


def _kept(written: Path, place: Path) -> None:
    """Keep text as it is, and of tables the figures of each column."""
    for file in sorted(each for each in written.rglob("*") if each.is_file()):
        kept = place / file.relative_to(written)
        kept.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix == ".parquet":
            text = json.dumps(columns(file), indent=1)
            kept.with_suffix(".columns.json").write_text(text + "\n", encoding="utf-8", newline="\n")
        else:
            shutil.copy(file, kept)


def columns(file: Path) -> dict[str, dict[str, Any]]:
    """Return of each column its type, rows, a digest of its values, and sums that show how far one is off."""
    import polars as pl

    found: dict[str, dict[str, Any]] = {}
    for column in pl.read_parquet(file):
        values = column.to_numpy()
        data = values.tobytes() if values.dtype != object else repr(values.tolist()).encode()
        found[column.name] = {
            "type": str(column.dtype),
            "rows": len(column),
            "sha256": hashlib.sha256(data).hexdigest(),
        }
        if column.dtype.is_numeric() and len(column):
            real = column.fill_nan(None).drop_nulls().cast(pl.Float64)
            found[column.name] |= {"sum": real.sum(), "absolute_sum": real.abs().sum()}
    return found

"""Runs made with the library's own effects, coloured noise and normal mismatch: for tests, not for scores."""

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import cutting
from gcode2krl.cell import resolve_cell
from gcode2krl.compliance import deflect
from gcode2krl.effects import Applied, inputs_of, library, parse, simulate
from gcode2krl.effects.chain import Inputs
from gcode2krl.gap.compare.pair import Pair, refined_prediction
from gcode2krl.gcode import read_stream
from gcode2krl.prediction import Prediction
from gcode2krl.runs import Controller, Force, Run, RunHead, Tracker
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

PROGRAM = """G21 G90 G17
G54
T1 M6
S13000 M3
G0 X-20 Y-60 Z20
G1 Z-4 F3000
G1 X120 F2400
G1 Y-20
G1 X-20
G0 Z15
G0 X140 Y40
G1 Z-3 F3000
G1 X60 Y60 F2400
G1 Y-40
G1 X-10 Y40 F3000
G0 Z25
G0 X100 Y-60
G0 Z5
G1 X-20 Y60 Z10 F6000
M30
"""
LIBRARY = library()
TRUE_STEP_S = 0.003


@functools.cache
def prediction(program: str = PROGRAM, dt_s: float = 0.012) -> Prediction:
    """Return a prediction with forces of a short part: about 20 s."""
    import io

    cell = resolve_cell(
        {
            "based_on": "demonstration",
            "stock": {"box_mm": [[0.0, -80.0, -30.0], [120.0, 80.0, 0.0]]},
            "controller": {"cdis_mm": 0.5},
        }
    )
    toolpath = read_stream(io.BytesIO(program.encode()), "part.nc", cell)
    from gcode2krl.pipeline import predict_toolpath

    nominal = predict_toolpath(toolpath, cell, dt_s=dt_s)
    assert nominal.motion is not None
    assert nominal.joints is not None
    if nominal.forces is not None:
        return nominal
    forces = cutting.cut(toolpath, nominal.motion, cell)
    return replace(nominal, forces=forces, deflection=deflect(nominal.joints, forces, cell))


@functools.cache
def refined() -> Prediction:
    """Return the prediction on the grid of a diagnosis, which so need not remove the material again."""
    return refined_prediction(prediction())


def applied(*texts: str) -> list[Applied]:
    return [parse(text, LIBRARY, prediction().cell) for text in texts]


def coloured(
    generator: np.random.Generator, shape: tuple[int, int], sigma: float, memory: float
) -> np.ndarray:
    """Return first-order autoregressive noise of rms ``sigma``."""
    white = generator.standard_normal(shape)
    out = np.empty(shape)
    out[0] = white[0]
    for i in range(1, len(out)):
        out[i] = memory * out[i - 1] + np.sqrt(1 - memory**2) * white[i]
    return sigma * out


def mismatch(generator: np.random.Generator, cell: Any) -> list[Applied]:
    """Return what differs between a sound robot and its model, drawn within the bounds."""
    found = []
    for name in cell.compliance.virtual_joints:
        found.append(Applied(LIBRARY["stiffness"], name, {"scale": 1 + generator.uniform(-0.08, 0.08)}))
    for way in ("tangential", "radial", "axial"):
        found.append(Applied(LIBRARY["force_scale"], way, {"scale": 1 + generator.uniform(-0.03, 0.03)}))
    for axis in range(6):
        found.append(Applied(LIBRARY["servo_lag"], f"A{axis + 1}", {"tau_s": generator.uniform(0, 5e-4)}))
        found.append(Applied(LIBRARY["backlash"], f"A{axis + 1}", {"gap_deg": generator.uniform(0, 5e-4)}))
    return found


def runs(
    effects: list[Applied],
    count: int = 3,
    seed: int = 0,
    *,
    sigma_mm: float = 0.02,
    sigma_N: float = 3.0,
    sigma_deg: float = 3e-4,
    load_encoders: bool = False,
    controller: bool = True,
    tracker: bool = True,
    force: bool = True,
    memory: float = 0.5,
    base: Prediction | None = None,
    extra: Any = None,
    normal: bool = True,
    tracker_hz: float = 100.0,
) -> list[Run]:
    """Return runs of one program with some effects at work."""
    generator = np.random.default_rng(seed)
    nominal = base or prediction(dt_s=TRUE_STEP_S)  # a robot is finer than any prediction of it
    usual = mismatch(generator, nominal.cell) if normal else []
    return [
        _run(
            number,
            inputs_of(nominal, hours=0.5 * number),
            [*effects, *usual],
            generator,
            sigma_mm,
            sigma_N,
            sigma_deg,
            load_encoders,
            controller,
            tracker,
            force,
            memory,
            extra,
            normal,
            tracker_hz,
        )
        for number in range(count)
    ]


@functools.cache
def side(
    *texts: str, program: str = PROGRAM, cuts: bool = True, normal: bool = False, **signals: bool
) -> Pair:
    """Return a run with some effects beside the nominal prediction, without a table of forces by default."""
    base = prediction(program, TRUE_STEP_S)
    base = base if cuts else replace(base, forces=None, deflection=None)
    (run,) = runs(applied(*texts), 1, 3, base=base, normal=normal, **({"force": False} | signals))
    return Pair(run=run, number=0, inputs=inputs_of(prediction(dt_s=TRUE_STEP_S)))


def _run(
    number: int,
    inputs: Inputs,
    effects: list[Applied],
    generator: np.random.Generator,
    sigma_mm: float,
    sigma_N: float,
    sigma_deg: float,
    load_encoders: bool,
    controller: bool,
    tracker: bool,
    force: bool,
    memory: float,
    extra: Any,
    normal: bool,
    tracker_hz: float,
) -> Run:
    from gcode2krl.gap.compare.interpolation import interpolate

    signals = simulate(inputs, effects)
    end = float(signals.time_s[-1])

    def table(kind: Any, hz: float, **columns: tuple[str, np.ndarray | None]) -> Any:
        off = generator.uniform(-0.002, 0.002) if normal else 0.0
        stamps = np.arange(0.0, end, 1.0 / hz)
        made = {}
        for name, (signal, noise) in columns.items():
            values = interpolate(signals, signal, signals.true_time(signal, stamps - off))
            if extra is not None:
                values = extra(name, values, stamps, signals, number)
            made[name] = values + (coloured(generator, values.shape, *noise) if noise else 0.0)
        segments = np.array([[0, len(stamps)]])
        rows = np.arange(len(stamps)) + 2
        return kind(time_s=stamps, row=rows, segments=segments, source=f"{kind.__name__}.csv", **made)

    made: dict[str, Any] = {}
    if controller:
        noise = (sigma_deg * RAD_PER_DEG, 0.0)
        columns = {"q_cmd_rad": ("q_cmd_rad", None), "q_act_rad": ("q_act_rad", noise)}
        if load_encoders:
            columns["q_load_rad"] = ("q_load_rad", noise)
        made["controller"] = table(Controller, 1.0 / 0.012, **columns)
        made["controller"] = replace(
            made["controller"],
            **{
                name: np.round(getattr(made["controller"], name) * DEG_PER_RAD, 5) * RAD_PER_DEG
                for name in columns
            },
        )
    if tracker:
        made["tracker"] = table(Tracker, tracker_hz, position_mm=("tcp_base_mm", (sigma_mm, memory)))
        if normal:
            shift = generator.uniform(-0.04, 0.04, 3) / np.sqrt(3)
            made["tracker"] = replace(made["tracker"], position_mm=made["tracker"].position_mm + shift)
    if force:
        made["force"] = table(Force, 100.0, force_N=("force_meas_base_N", (sigma_N, memory)))
        if normal:
            gain = 1 + generator.uniform(-0.02, 0.02, 3)
            zero = generator.uniform(-3, 3, 3)
            made["force"] = replace(made["force"], force_N=made["force"].force_N * gain + zero)
    return Run(f"run-{number + 1}", Path(f"run-{number + 1}"), RunHead(), **made)


def bent(values: np.ndarray, stamps: np.ndarray, signals: Any, more_N: np.ndarray) -> np.ndarray:
    """Return tips (n, 3) at some stamps of an arm that more force (m, 3) bends."""
    from gcode2krl.gap.compare.interpolation import interpolate

    plain = replace(signals.inputs, forces=None)
    loaded = replace(plain, force_base_N=signals.force_base_N + more_N)
    now, before = (simulate(inputs).tcp_base_mm for inputs in (loaded, plain))
    return values + interpolate(replace(signals, tcp_base_mm=now - before), "tcp_base_mm", stamps)


def write_log(run: Run, file: Path) -> Path:
    """Write the actual joints of a run as people have them: Time, Axis1 … Axis6."""
    import polars as pl

    assert run.controller is not None
    assert run.controller.q_act_rad is not None
    deg = run.controller.q_act_rad * DEG_PER_RAD
    columns = {"Time": run.controller.time_s} | {f"Axis{n + 1}": deg[:, n] for n in range(6)}
    pl.DataFrame(columns).write_csv(file)
    return file


def write(run: Run, folder: Path, head: str = "") -> Path:
    """Write a run as the folder that a user would have."""
    import polars as pl

    place = folder / run.name
    place.mkdir()
    (place / "run.toml").write_text(head, encoding="utf-8")
    tables: dict[str, dict[str, np.ndarray]] = {}
    if run.controller is not None:
        table = tables["controller"] = {"t_s": run.controller.time_s}
        for side in ("cmd", "act", "load"):
            values = getattr(run.controller, f"q_{side}_rad")
            for axis in range(6 if values is not None else 0):
                table[f"q{axis + 1}_{side}_deg"] = values[:, axis] * DEG_PER_RAD
    if run.tracker is not None:
        named = zip(("x_mm", "y_mm", "z_mm"), run.tracker.position_mm.T, strict=True)
        tables["tracker"] = {"t_s": run.tracker.time_s, **dict(named)}
    if run.force is not None:
        named = zip(("fx_N", "fy_N", "fz_N"), run.force.force_N.T, strict=True)
        tables["force"] = {"t_s": run.force.time_s, **dict(named)}
    for name, columns in tables.items():
        pl.DataFrame(columns).write_csv(place / f"{name}.csv")
    return place

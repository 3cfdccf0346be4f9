"""``gcode2krl online``: the twin, the RSI server, and the replay of a recorded run."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    cell_files,
    common_options,
    existing,
    gcode_options,
    read_cell,
    read_part,
    require_folder,
    require_other,
)
from gcode2krl.errors import Gcode2KrlError, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.cell.sections.online import Online
    from gcode2krl.prediction import Prediction

TEST_PIECE_STOCK = ((0.0, -100.0, -30.0), (300.0, 100.0, 0.0))
"""Stock of the test piece, as its file states it."""
_MS = 1000.0
_FIGURES = ("deviation", "signals")
_RUN_FILES = ("run.toml", "rsi.log", "force.csv", "events.csv")


@click.group(
    "online", epilog=examples("gcode2krl online simulate part.nc", "gcode2krl online serve --files rsi/")
)
def command() -> None:
    """Compensate online: the twin, the RSI server, replay.

    Python is not a hard real-time controller: this is the reference against which a PLC version is checked.
    """


@command.command(
    "simulate",
    epilog=examples(
        "gcode2krl online simulate",
        "gcode2krl online simulate part.nc --cell cell.toml --plot twin/",
        "gcode2krl online simulate part.nc --late-ms 40 --noise-N 5 --json",
    ),
)
@click.argument("part", required=False)
@common_options
@gcode_options
@click.option("--lead-ms", type=float, metavar="MS", help="How far ahead the pilot force is read.")
@click.option("--threshold-N", "threshold_N", type=float, metavar="N", help="Use the pilot above this error.")
@click.option("--blend-ms", type=float, metavar="MS", help="Time of the blend to the pilot.")
@click.option("--filter-ms", type=float, metavar="MS", help="Delay of low-pass and average together.")
@click.option("--robot-delay-ms", type=float, metavar="MS", help="Dead time and lag of the robot together.")
@click.option("--feed-scale", type=float, default=1.0, show_default=True, help="Real speed over predicted.")
@click.option("--pilot-scale", type=float, metavar="X", help="Pilot force over the true one.")
@click.option("--sensor-gain", type=float, metavar="X", help="Measured force over the true one.")
@click.option("--late-ms", type=float, metavar="MS", help="Cutter enters and leaves later than predicted.")
@click.option("--noise-N", "noise_N", type=float, metavar="N", help="1-sigma of the force sensor.")
@click.option("--backlash-deg", type=float, metavar="DEG", help="Play of every drive.")
@click.option("--plot", type=click.Path(), metavar="FOLDER", help="Draw deviation maps and force signals.")
def simulate_command(
    part: str | None,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    tolerance_mm: float | None,
    chord_tolerance_mm: float,
    dialect: str,
    search: tuple[str, ...],
    block_delete: bool,
    plot: str | None,
    **options: Any,
) -> int:
    """Run a part on the twin: how much of the deflection the compensator takes away.

    The predicted forces are the truth; the compensator gets them late, noisy and slightly wrong.
    Without PART the test piece of Haehn & Weigold 2020.
    """
    console = Console(quiet, as_json)
    inputs = existing(part, *cell_files(cell_path))
    require_folder(plot, [f"{name}.png" for name in _FIGURES], inputs)
    cell = read_cell(cell_path)
    settings = _changed(cell.online, options)
    world_values = _world_values(options)
    prediction = _predicted(
        part, cell, settings, console, tolerance_mm, chord_tolerance_mm, block_delete, dialect, search
    )
    from gcode2krl.online.judge import judged as judge
    from gcode2krl.online.outcome import as_json as outcome_json
    from gcode2krl.online.outcome import findings, simulate_all
    from gcode2krl.online.twin import World, twin_of

    world = World(**world_values)
    twin = twin_of(prediction, settings, world)
    judged = judge(prediction, settings.memory_s, world.late_s)
    with console.stage("simulating") as progress:
        runs = simulate_all(twin, progress)
    motion = prediction.motion
    lines = prediction.toolpath.source_line[motion.move] if motion is not None else np.zeros(0, np.int32)
    outcome = outcome_json(twin, runs, judged, lines)
    issues = [*prediction.issues, *findings(twin, runs, judged)]
    files = _draw(prediction, twin, runs, judged, outcome, Path(plot), inputs) if plot is not None else []
    if as_json:
        return console.record(outcome, issues, files=files)
    console.findings(issues, part or "test piece", notes=False)
    console.say(f"{part or 'test piece'}: deviation normal to the feed of what stays on the part")
    for line in _table(outcome):
        console.say(line)
    for file in files:
        console.say(f"  {file}")
    return 0


_WORDS = {
    "uncompensated": "without compensation",
    "cartesian": "Cartesian, measured force alone",
    "pilot": "Cartesian with pilot",
    "axis": "axis-specific with pilot, drives with play",
}


def _table(outcome: dict[str, Any]) -> Iterator[str]:
    """Yield RMS and largest deviation of each case, then what the pilot gains and where it does not."""
    yield f"  {'':<42} {'RMS':>9} {'largest':>9} {'in line':>8}"
    for case, words in _WORDS.items():
        gain, largest_mm = outcome["gain"][case], outcome[f"{case}_mm"]
        if gain is None or largest_mm is None:
            yield f"  {words:<42} {'-':>9} {'-':>9}"
            continue
        yield f"  {words:<42} {gain['rms_mm']:>6.3f} mm {largest_mm:>6.3f} mm {gain['worst_line']:>8}"
    yield from _depth_lines(outcome["depth"])
    gain = outcome["gain"]["pilot"]
    if gain is None or gain["rms_less_percent"] is None or outcome["reduction_percent"] is None:
        return
    yield f"  with pilot RMS {_less(gain['rms_less_percent'])}, largest {_less(outcome['reduction_percent'])}"
    yield (
        f"  nearer to nominal {100.0 * gain['better_share']:.0f} % of the time in the cut, "
        f"farther {100.0 * gain['worse_share']:.0f} %{_where(gain['worse'])}"
    )


def _depth_lines(depth: dict[str, Any] | None) -> Iterator[str]:
    """Yield the share of the depth error that each case takes away, by the direction of the correction."""
    for kind, words in (("with", "with its axis"), ("against", "turning its axis")):
        side = depth[kind] if depth is not None else None
        if side is not None:
            removed = ", ".join(f"{case} {share:.0f} %" for case, share in side["removed_percent"].items())
            yield f"  depth, correction {words} ({side['share']:.1%} of the cut): {removed} removed"


def _less(percent: float) -> str:
    return f"{percent:.0f} % less" if percent >= 0.0 else f"{-percent:.0f} % more"


def _where(worse: list[dict[str, Any]]) -> str:
    """Return the lines in which the compensation makes it worse."""
    lines = ", ".join(f"{each['line']} (by {each['excess_mm']:.2f} mm)" for each in worse[:3])
    return f", most in line {lines}" if len(worse) == 1 else f", most in lines {lines}" if worse else ""


def _changed(settings: "Online", options: dict[str, Any]) -> "Online":
    """Return the settings with the options of the command line laid over them."""
    changes: dict[str, Any] = {}
    for name, key in (("lead_ms", "lead_s"), ("blend_ms", "blend_s")):
        if options[name] is not None:
            changes[key] = options[name] / _MS
    if options["threshold_N"] is not None:
        changes["threshold_N"] = options["threshold_N"]
    if options["filter_ms"] is not None:
        ratio = options["filter_ms"] / (_MS * settings.filter_s)
        if not ratio > 0.0:
            raise input_error("option-value", f"--filter-ms {options['filter_ms']:g}: allowed above 0")
        changes |= {"lowpass_hz": settings.lowpass_hz / ratio, "average_s": settings.average_s * ratio}
    if options["robot_delay_ms"] is not None and settings.lead_s is None and "lead_s" not in changes:
        changes["robot_delay_s"] = options["robot_delay_ms"] / _MS
    return _valid(settings, changes)


def _valid(settings: "Online", changes: dict[str, Any]) -> "Online":
    from pydantic import ValidationError

    from gcode2krl.cell.sections.online import Online

    try:
        return Online.model_validate({**settings.model_dump(), **changes})
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        key = ".".join(str(step) for step in detail["loc"])
        words = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        is_sentence = detail["type"] == "value_error"
        text = words if is_sentence else f"found {detail['input']}, allowed: {words}"
        raise input_error("option-value", f"{key}: {text}") from None


def _world_values(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options that describe the twin's world."""
    named = ("feed_scale", "pilot_scale", "sensor_gain", "noise_N", "backlash_deg")
    values = {name: float(options[name]) for name in named if options[name] is not None}
    if options["robot_delay_ms"] is not None:
        half_s = 0.5 * options["robot_delay_ms"] / _MS
        values |= {"dead_s": half_s, "lag_s": half_s}
    if options["late_ms"] is not None:
        values["late_s"] = options["late_ms"] / _MS
    for name, value in values.items():
        least_ok = value > 0.0 if name == "feed_scale" else value >= 0.0 or name == "late_s"
        if not (np.isfinite(value) and least_ok):
            raise input_error("option-value", f"{name}: found {value:g}, allowed: a number above 0")
    return values


def _predicted(
    part: str | None,
    cell: "Cell",
    settings: "Online",
    console: Console,
    tolerance_mm: float | None,
    chord_tolerance_mm: float,
    block_delete: bool,
    dialect: str,
    search: tuple[str, ...],
) -> "Prediction":
    """Predict a part at the cycle of the settings; a prediction's folder is loaded unchanged."""
    from gcode2krl.prediction import Prediction

    if part is not None and Path(part).is_dir():
        return Prediction.load(part)
    if part is None:
        part = str(_test_piece())
        if cell.stock is None:
            from gcode2krl.cell.sections import Stock

            cell = cell.model_copy(update={"stock": Stock(box_mm=TEST_PIECE_STOCK)})
    from gcode2krl.pipeline import predict_toolpath

    try:
        toolpath = read_part(part, cell, console, chord_tolerance_mm, block_delete, dialect, search)
        with console.stages() as begin:
            return predict_toolpath(
                toolpath, cell, dt_s=settings.cycle_s, tolerance_mm=tolerance_mm, begin=begin
            )
    except Gcode2KrlError as error:
        error.source = error.source or part
        raise


def _test_piece() -> Path:
    """Return the file of the test piece, from the installed package or the checkout."""
    from gcode2krl.cell.library import models_folder

    models = models_folder()
    places = (models / "test_piece.nc", models.parent / "examples" / "test_piece.nc")
    files = [place for place in places if place.is_file()]
    if not files:
        raise input_error("file-unreadable", "the test piece is not installed", "name a part")
    return files[0]


def _draw(
    prediction: "Prediction",
    twin: Any,
    runs: Any,
    judged: Any,
    outcome: dict[str, Any],
    folder: Path,
    inputs: list[Path],
) -> list[Path]:
    from gcode2krl.online.surface import surface_of
    from gcode2krl.report.figures import save_figures
    from gcode2krl.report.twin_figures import Map, Signals, deviation_figure, signal_figure

    maps = {
        words.capitalize() if words[0] != "C" else words: Map(
            *surface_of(prediction, runs[case], judged),
            outcome[f"{case}_mm"],
            outcome["gain"][case]["rms_mm"] if outcome["gain"][case] is not None else None,
        )
        for case, words in _WORDS.items()
    }
    run = runs["pilot"]
    device = run.device
    signals = Signals(
        run.time_s,
        run.force_N,
        device.measured[:, :3],
        device.estimate_N,
        device.load[:, :3],
        device.weight,
        run.needed_mm,
        np.linalg.norm(run.shift_mm, axis=1),
        twin.settings.threshold_N,
    )
    worst = np.where(judged.counts, runs["cartesian"].normal_mm, 0.0)
    around_s = float(run.time_s[int(np.argmax(worst))]) if len(worst) else 0.0
    drawn = (deviation_figure(maps), signal_figure(signals, around_s))
    return save_figures(dict(zip(_FIGURES, drawn, strict=True)), folder, inputs)


@command.command(
    "replay",
    epilog=examples("gcode2krl online replay run-1/", "gcode2krl online replay run-1/ -o cycles.csv"),
)
@click.argument("run", type=click.Path())
@common_options
@click.option("--pilot", "sidecar", type=click.Path(), help="Sidecar of the program that ran.")
@click.option("--tool", type=int, default=1, show_default=True, help="Tool in the spindle.")
@click.option("-o", "--output", type=click.Path(), metavar="FILE", help="Write a row for each cycle as CSV.")
def replay_command(
    run: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    sidecar: str | None,
    tool: int,
    output: str | None,
) -> int:
    """Run the compensator on a recorded run: which corrections would it have sent?"""
    from gcode2krl.files import write_together

    console = Console(quiet, as_json)
    console.heading.reads(run, sidecar)
    inputs = existing(run, sidecar, *cell_files(cell_path))
    if output is not None:
        require_other(Path(output), *inputs)
    cell = read_cell(cell_path)
    from gcode2krl.online.log_replay import as_json as replay_json
    from gcode2krl.online.log_replay import columns, replay
    from gcode2krl.runs import load_run

    knots, header = _pilot(sidecar)
    result = replay(
        load_run(run),
        cell,
        cell.online,
        tool=tool,
        calibration=_calibration(cell.online),
        knots=knots,
        header=header,
    )
    record = replay_json(result)
    if output is not None:
        import polars as pl

        write_together({Path(output): pl.DataFrame(columns(result)).write_csv}, inputs)
    if as_json:
        return console.record(record, result.issues, files=[output] if output is not None else [])
    console.findings(result.issues, run, notes=False)
    console.say(f"{run}: {record['cycles']} cycles, {record['time_s']:.1f} s")
    most_mm, most_N = record["max_correction_mm"], record["max_force_N"]
    console.say(f"  largest correction {most_mm:.3f} mm, largest force {most_N:.0f} N")
    if record["before_mm"] is not None:
        before, after = record["before_mm"], record["after_mm"]
        console.say(f"  deviation normal to the feed {before:.3f} mm, left {after:.3f} mm")
    console.say(f"  pilot in {record['pilot_cycles']} cycles; {_gates(record['gate_cycles'])}")
    return 0


@command.command(
    "serve",
    epilog=examples(
        "gcode2krl online serve --files rsi/ --most-mm 0.5",
        "gcode2krl online serve --pilot part.pilot.csv --cycle-ms 4 -o run-4/",
    ),
)
@common_options
@click.option("--pilot", "sidecar", type=click.Path(), help="Sidecar of the program that will run.")
@click.option("--tool", type=int, default=1, show_default=True, help="Tool in the spindle.")
@click.option(
    "--mode", type=click.Choice(["cartesian", "axis"]), help="What is corrected; default: the cell's."
)
@click.option("--address", metavar="IP", help="Where to listen; default: the cell's, loopback.")
@click.option("--robot-address", metavar="IP", help="The controller's: only its telegrams are read.")
@click.option("--port", type=int, metavar="N", help="UDP port; default: the cell's, 49152.")
@click.option("--cycle-ms", type=click.Choice(["4", "12"]), help="#IPO_FAST or #IPO; default: the cell's.")
@click.option("--most-mm", type=float, metavar="MM", help="Largest correction; default: the cell's.")
@click.option("-o", "--output", type=click.Path(), metavar="FOLDER", help="Record the run there.")
@click.option("--files", type=click.Path(), metavar="FOLDER", help="Write the controller's files, and end.")
@click.option("--name", default="GK_RSI", show_default=True, help="Name of the controller's files.")
def serve_command(
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    sidecar: str | None,
    tool: int,
    output: str | None,
    files: str | None,
    name: str,
    **options: Any,
) -> int:
    """Answer a controller's RSI telegrams with corrections. Not a safety function, not hard real time.

    Listens on loopback unless [online.link] or --address says otherwise, talks to one controller (that of
    robot_address, else the first that sends a telegram), and stays at zero until the robot has shown in air
    that it takes corrections as absolute. The force comes in the telegram (element Force).
    """
    console = Console(quiet, as_json)
    console.heading.reads(sidecar)
    inputs = existing(sidecar, *cell_files(cell_path))
    require_folder(output, _RUN_FILES, inputs)
    cell = read_cell(cell_path)
    settings = _link_changed(cell.online, options)
    knots, header = _pilot(sidecar)
    form = header.form if header is not None else "none"
    if files is not None:
        changed = cell.model_copy(update={"online": settings})
        written = _controller_files(changed, form, name, Path(files), inputs)
        _say_files(written, settings.link.address, console)
        return 0
    from gcode2krl.online.compensator import build_compensator
    from gcode2krl.online.recorder import Recorder
    from gcode2krl.online.server import open_socket, serve
    from gcode2krl.online.session import Phase

    device = build_compensator(
        cell,
        settings,
        tool=tool,
        load_frame="sensor",
        calibration=_calibration(settings),
        knots=knots,
        header=header,
    )
    with open_socket(device) as socket, Recorder(Path(output) if output else None, _RUN_HEAD) as recorder:
        address, port = socket.getsockname()
        console.hint(f"listening on {address}:{port}; Ctrl-C ends it. This is not a safety function.")
        if settings.link.robot_address is None and not address.startswith("127."):
            console.hint("the first sender of a telegram is taken as the controller: set robot_address")
        try:
            session, statistics = serve(
                device,
                socket,
                recorder,
                on_change=lambda now: console.hint(f"  {now.phase.value} {now.reason}".rstrip()),
            )
        except KeyboardInterrupt:
            console.hint("stopped: the controller's own time-out stops the robot")
            return 130
    record = {
        **statistics.as_dict(),
        "phase": session.phase.value,
        "reason": session.reason,
        "lost": session.lost,
        "ignored": session.ignored,
        "log_dropped": recorder.dropped,
        "log_unwritten": recorder.unwritten,
    }
    is_complete = recorder.dropped == recorder.unwritten == 0
    is_done = session.phase is Phase.CLOSED and session.reason == "silence" and is_complete
    console.say("\n".join(f"  {key} {value}" for key, value in record.items()))
    return console.record(record, exit_code=0 if is_done else 1)


_RUN_HEAD = """\
[frames]
force = "sensor"

[channels]
rsi = true
correction = "absolute"
"""


def _pilot(sidecar: str | None) -> Any:
    """Return knots and header of a sidecar, None where there is none."""
    if sidecar is None:
        return None, None
    from gcode2krl.pilot import read_pilot

    return read_pilot(sidecar)


def _calibration(settings: "Online") -> Any:
    """Return weight and offset of the sensor, None where the section names no file."""
    if settings.calibration is None:
        return None
    from gcode2krl.compliance.sensor import read_calibration

    return read_calibration(settings.calibration)


def _gates(cycles: dict[str, int]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in cycles.items())


def _link_changed(settings: "Online", options: dict[str, Any]) -> "Online":
    """Return the settings with the options of `serve` laid over them."""
    keys = ("address", "robot_address", "port")
    link = {key: options[key] for key in keys if options[key] is not None}
    changes: dict[str, Any] = {"link": {**settings.link.model_dump(), **link}}
    if options["mode"] is not None:
        changes["mode"] = options["mode"]
    if options["cycle_ms"] is not None:
        changes["cycle_s"] = float(options["cycle_ms"]) / _MS
    if options["most_mm"] is not None:
        changes["most_mm"] = options["most_mm"]
    return _valid(settings, changes)


def _say_files(files: list[Path], address: str, console: Console) -> None:
    if address.startswith("127."):
        console.hint("the controller will look for the server at 127.0.0.1: name the PC with --address")
    console.record({}, files=files)
    for file in files:
        console.say(str(file))


def _controller_files(cell: "Cell", form: Any, name: str, folder: Path, inputs: list[Path]) -> list[Path]:
    """Write the files for the controller's folder ``SensorInterface``."""
    from gcode2krl.files import make_folder, write_together
    from gcode2krl.krl.rsi_files import rsi_texts
    from gcode2krl.krl.versions import version_issues

    if cell.online.link.address == "0.0.0.0":
        words = "the controller cannot look for the server at 0.0.0.0"
        raise input_error("online-address", words, "give --address, that of the PC in the robot's network")
    for issue in version_issues(cell):
        raise input_error(issue.code, issue.message, issue.remedy)
    texts = rsi_texts(name, cell.online, cell.pilot, form, cell.controller.rsi_version)
    make_folder(folder)
    files = {folder / key: text.replace("\n", "\r\n").encode("ascii") for key, text in texts.items()}
    write_together(files, inputs)
    return list(files)

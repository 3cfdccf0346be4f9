"""Set-up slips: a wrong number somewhere. Most real gaps are one of them."""

from dataclasses import replace

import numpy as np

from tests.plant import arm as arms
from tests.plant.effects.registry import SIZE, SLIPS, Draw, acting, declare, numbers
from tests.plant.robot import SLOW, Run, fast, joints_for, take_cut, to_base
from tests.plant.scene import DEGREE, Frame
from tests.plant.waypoints import PROGRAMS


def _shift_work(run: Run, shift_mm: np.ndarray) -> None:
    """The tool cuts this much beside the programmed place: the block moves the other way."""
    run.world = run.world.but(stock_mm=run.world.stock_mm - shift_mm)


@declare(SLIPS, "set-up", 2.0, 80.0, signal="tcp")
def tool_number(draw: Draw):
    """The controller computes with another tool's frame; the tool in the spindle is the right one."""
    sign, way = draw.sign(), np.array([1.0, draw.uniform(-0.3, 0.3), draw.uniform(-0.3, 0.3)])

    def at(size):
        off = sign * size * way

        def world(run: Run):
            tool = run.believed.tool
            run.believed = run.believed.but(tool=Frame(tool.origin_mm - off, tool.axes))
            _shift_work(run, tool.axes.T @ off)

        return numbers(frame_off_mm=off), {"world": world}

    return None, at


@declare(SLIPS, "set-up", 2.0, 150.0, signal="tcp")
def base_number(draw: Draw):
    """The controller computes with another base's frame."""
    way = draw.direction() * np.array([1.0, 1.0, 0.2])

    def world(run: Run, size: float):
        base = run.believed.base
        run.believed = run.believed.but(base=Frame(base.origin_mm + size * way, base.axes))
        _shift_work(run, size * way)

    return None, acting(world, frame_off_mm=lambda size: size * way)


@declare(SLIPS, "set-up", 0.1, 0.7, signal="tcp")
def override(draw: Draw):
    """The hand-held's override is not at 100 %: programmed speeds shrink, accelerations stay."""

    def at(size):
        percent = round(100.0 * (1.0 - size))

        def world(run: Run):
            run.way = replace(run.way, speed_mm_s=run.way.speed_mm_s * percent / 100.0)

        return numbers(percent=percent), {"world": world}

    return None, at


@declare(SLIPS, "set-up", 0.6, 1.0, signal="tcp", needs=("cut",))
def rsi_on(draw: Draw):
    """An online compensation was at work: the drives get the programmed path minus a modelled deflection."""
    delay_s = draw.uniform(0.08, 0.15)

    def at(size):
        def lags(run: Run):
            arm, slow = arms.reference_pose(run.believed), np.ascontiguousarray(run.q_cmd[::SLOW])
            root = run.believed.base.axes.T
            turning = arms.torques(arm, slow, run.compensated_N @ root, run.compensated_Nmm @ root)
            bent = arms.bent(arm, slow, turning / run.believed.stiffness_Nmm_rad)[0]
            off = to_base(run.believed, bent) - run.place_mm[::SLOW]
            off -= _along(run, off)
            correction = fast(run, -size * off)
            late = [np.interp(run.t_s - delay_s, run.t_s, correction[:, k]) for k in range(3)]
            run.q_drive = joints_for(run.believed, run.place_mm + np.stack(late, axis=1))

        def command(run: Run):
            take_cut(run)
            run.compensated_N, run.compensated_Nmm = run.cut.force_N, run.cut.moment_Nmm

        def servo(run: Run):
            run.q_act = run.q_act + run.q_drive - run.q_cmd

        return numbers(gain=size, delay_s=delay_s), {"command": command, "lags": lags, "servo": servo}

    return None, at


def _along(run: Run, off: np.ndarray) -> np.ndarray:
    """Component of an offset along the feed."""
    v = run.velocity_mm_s
    square = np.sum(v * v, axis=1, keepdims=True)
    return np.where(square > 1e-6, np.sum(off * v, axis=1, keepdims=True) / np.maximum(square, 1e-6) * v, 0.0)


@declare(SLIPS, "set-up", 15.0, 80.0, signal="tcp")
def load(draw: Draw):
    """The load data of another tool: the arm sags by the difference, the drives lag a little."""
    centre = draw.rng.uniform([-50.0, -100.0, 50.0], [50.0, 100.0, 250.0])

    def at(size):
        def world(run: Run):
            run.payload.append((size, centre))

        def lags(run: Run):
            run.lag_s += 5e-5 * size

        return numbers(kg=size), {"world": world, "lags": lags}

    return None, at


@declare(SLIPS, "set-up", 0.2, 2.0, signal="joint_commanded")
def absolute_accuracy(draw: Draw):
    """The controller's own error model is on: its angles are not the nominal ones, its place is right."""
    lengths, zeros = draw.rng.uniform(-1.0, 1.0, 6), draw.rng.uniform(-0.05, 0.05, 6)

    def at(size):
        def world(run: Run):
            for which in ("world", "believed"):
                old = getattr(run, which)
                setattr(run, which, old.but(lengths_mm=old.lengths_mm + size * lengths))
            run.zero_rad = run.zero_rad + size * zeros * DEGREE

        def command(run: Run):
            run.q_cmd = run.q_cmd - size * zeros * DEGREE

        return numbers(lengths_mm=size * lengths, zeros_deg=size * zeros), {
            "world": world,
            "command": command,
        }

    return None, at


@declare(SLIPS, "set-up", 0.5, 6.0, signal="tcp")
def other_program(draw: Draw):
    """Another program than predicted: an edited one, or a different one."""
    kind, row_share = draw.pick(["shifted", "slower", "another"]), draw.uniform(0.2, 0.8)

    def world(run: Run, size: float):
        way = run.way
        from_row = max(1, int(row_share * len(way)))
        if kind == "shifted":
            place = way.position_mm.copy()
            place[from_row:, 1] += size
            run.way = replace(way, position_mm=place)
        elif kind == "slower":
            speed = np.where(way.cutting, way.speed_mm_s / (1.0 + 0.2 * size), way.speed_mm_s)
            run.way = replace(way, speed_mm_s=speed)
        else:
            programs = [p().waypoints() for p in PROGRAMS.values()]
            unlike = [p for p in programs if p.position_mm.shape != way.position_mm.shape]
            run.way = unlike[(from_row + run.number) % len(unlike)]

    return None, acting(world, kind=kind, size=SIZE)


@declare(SLIPS, "set-up", 1.0, 1.0)
def unit(draw: Draw):
    """One table is written in another unit than its header says."""
    table, factor = draw.pick(
        [("tracker", 1e-3), ("tracker", 1.0 / 25.4), ("force", 1e-3), ("force", 0.1019716)]
    )

    def sense(run: Run, size: float):
        run.units[table] = factor

    return table, acting(sense, table=table, factor=factor)


@declare(SLIPS, "set-up", 1.0, 20.0)
def swapped_tool(draw: Draw):
    """Another mill in the spindle: thicker or thinner, or longer or shorter."""
    kind, sign = draw.target(("diameter", "length")), draw.sign()

    def world(run: Run, size: float):
        if kind == "diameter":
            diameter = float(np.clip(run.world.cutter.diameter_mm + sign * size, 6.0, 25.0))
            run.world = run.world.cutting(diameter_mm=diameter)
        else:
            tool = run.world.tool
            below = np.array([0.0, 0.0, -sign * size])
            run.world = run.world.but(tool=Frame(tool.origin_mm + tool.axes @ below, tool.axes))
            _shift_work(run, below)

    return kind, acting(world, mm=lambda size: sign * size)

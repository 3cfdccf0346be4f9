"""Channels of a measured run that can be taken away, and whether an effect still shows without one."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")


def _columns(pattern: str, joints: Iterable[int] = range(1, 7)) -> tuple[str, ...]:
    return tuple(pattern.format(joint) for joint in joints)


@dataclass(frozen=True)
class Channel:
    """A table of a run, or columns of it."""

    table: str
    columns: tuple[str, ...] = ()
    """The whole table where empty."""
    signals: tuple[str, ...] = ()
    """Signals of the label that go with it."""
    joints: tuple[str, ...] = JOINTS
    """Joints whose signals go with it."""


LOAD = "q{}_load_deg"
CHANNELS = {
    "tracker": Channel("tracker", signals=("tcp",)),
    "orientation": Channel("tracker", ("a_deg", "b_deg", "c_deg")),
    "force": Channel("force", signals=("force",)),
    "moments": Channel("force", ("mx_Nm", "my_Nm", "mz_Nm")),
    "controller": Channel("controller", signals=("joint_commanded", "joint_actual", "joint_load")),
    "load encoders": Channel("controller", _columns(LOAD), ("joint_load",)),
    "load encoders of A1-A3": Channel("controller", _columns(LOAD, (1, 2, 3)), ("joint_load",), JOINTS[:3]),
    "load encoders of A4-A6": Channel("controller", _columns(LOAD, (4, 5, 6)), ("joint_load",), JOINTS[3:]),
    "motor torques": Channel("controller", _columns("tau{}_Nm")),
    "scan": Channel("scan", signals=("scan",)),
}
"""Name -> what is taken away."""
MEASURES = ("tracker", "force", "controller")
"""At least one of these tables must be left."""


def without(channel: Channel, case: Path, to: Path) -> bool:
    """Copy a case without a channel; False, and no copy, where it has none or nothing else."""
    shutil.copytree(case, to)
    changed = [_taken(channel, run) for run in sorted(to.glob("run-*"))]
    left = all(any(_file(run, table) for table in MEASURES) for run in to.glob("run-*"))
    if any(changed) and left:
        return True
    shutil.rmtree(to)
    return False


def _taken(channel: Channel, run: Path) -> bool:
    file = _file(run, channel.table)
    if file is None:
        return False
    if not channel.columns:
        file.unlink()
        return True
    binary = file.suffix == ".parquet"
    table = pl.read_parquet(file) if binary else pl.read_csv(file, infer_schema_length=None)
    present = [name for name in channel.columns if name in table.columns]
    smaller = table.drop(present)
    if binary:
        smaller.write_parquet(file)
    else:
        smaller.write_csv(file)
    return bool(present)


def _file(run: Path, table: str) -> Path | None:
    return next((file for ending in ("csv", "parquet") if (file := run / f"{table}.{ending}").exists()), None)


def shows_without(channel: Channel, entry: dict[str, Any]) -> bool:
    """Tell whether an effect is at least as large as the noise in a signal that is left without a channel."""
    joints = set((entry.get("depends") or {}).get("joints") or JOINTS)
    gone = set(channel.signals) if joints <= set(channel.joints) else set()
    ratios = {name: signal["ratio"] for name, signal in entry["signals"].items()}
    ratios[entry["main_signal"]] = entry["ratio"]
    return any(ratio >= 1.0 for name, ratio in ratios.items() if name not in gone)

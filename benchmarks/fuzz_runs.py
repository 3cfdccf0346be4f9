"""Damaged and made-up run folders: tables as CSV and Parquet, KRC traces, RSI logs, scans, run.toml.

python benchmarks/fuzz_runs.py --count 10000 --seed 1
"""

import io
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzz_common import Try, main_of, mutated

ROWS = 60
HEAD = (
    'angles = "absolute"\nmode = "AUT"\n[frames]\ntracker = "base"\n[noise]\ntcp_mm = 0.03\n'
    "[clocks]\ntracker_s = 0.0\n"
)
VALUES = (
    "-1",
    "0",
    "1e308",
    "nan",
    "inf",
    "true",
    '"text"',
    "[]",
    "{}",
    '"../../../etc"',
    '"run.toml"',
    '"."',
    "2147483648",
    "99999999999999999999",
    "1979-05-27",
    '"' + "x" * 5000 + '"',
    '"\\u0000"',
)
KEYS = (
    "cell",
    "program",
    "prediction",
    "started",
    "angles",
    "mode",
    "override_percent",
    "notes",
    "frames",
    "files",
    "files.controller",
    "files.scan",
    "clocks.force_s",
    "channels.decimals",
    "noise",
    "a.b",
)
DEPTHS = (
    "[" * 100_000,
    "{a=" * 20_000,
    "a." * 20_000 + "a=1",
    "[a" + ".a" * 20_000 + "]",
    "\x00",
    "notes = " + "[" * 50_000,
)
CELLS = ("", "nan", "inf", "-1e308", "abc", "1,5", "1e999", '"', "\x00", "9" * 400, "é", "-0", "\t")
Files = dict[str, bytes]


def prepare(place: Path) -> Try:
    """Make good files once; return the function that tries a case."""
    from gcode2krl.runs import check_against, load_run

    files = good_files(place)
    folder = place / "run"
    time_s = np.linspace(0.0, 0.7, 200)
    position = np.stack([50.0 * time_s, 5.0 * np.sin(9.0 * time_s), 0.0 * time_s], axis=1)

    def attempt(rng: np.random.Generator, _: Path) -> str:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir()
        (folder / "run.toml").write_text(HEAD, encoding="utf-8")
        chosen = _chosen(rng, files)
        for name, data in chosen.items():
            (folder / name).write_bytes(data)
        what = CASES[int(rng.integers(len(CASES)))](rng, folder, chosen, files)
        run = load_run(folder, partial=bool(rng.random() < 0.3))
        joints = np.radians(np.tile([10.0, -70.0, 95.0, 12.0, -40.0, 30.0], (len(time_s), 1)))
        check_against(run, time_s, position, joints + 0.01 * position[:, :1])
        for issue in run.issues:
            issue.text("run.toml")
        return what

    return attempt


def good_files(place: Path) -> Files:
    """Return good files by name."""
    import polars as pl

    t = np.arange(ROWS) * 0.012
    position = np.stack([50.0 * t, 5.0 * np.sin(9.0 * t), 0.0 * t], axis=1)
    controller = {"t_s": t} | {f"{a}_cmd_mm": position[:, i] for i, a in enumerate("xyz")}
    for kind in ("cmd", "act"):
        controller |= {f"q{n}_{kind}_deg": 10.0 * n + (0.3 + 0.1 * n) * position[:, 0] for n in range(1, 7)}
    tracker = {"t_s": t} | {f"{a}_mm": position[:, i] + 0.01 * np.cos(40.0 * t) for i, a in enumerate("xyz")}
    force = {"t_s": t} | {f"f{a}_N": 100.0 * np.sin(20.0 * t + i) for i, a in enumerate("xyz")}
    scan = {f"{a}_mm": position[:, i] for i, a in enumerate("xyz")}
    files: Files = {}
    for name, columns in (("controller", controller), ("tracker", tracker), ("force", force), ("scan", scan)):
        frame, out = pl.DataFrame(columns), io.BytesIO()
        frame.write_parquet(out)
        files |= {f"{name}.csv": frame.write_csv().encode(), f"{name}.parquet": out.getvalue()}
    axes = "property float x\nproperty float y\nproperty float z\n"
    ply = f"ply\nformat {{}} 1.0\nelement vertex {{}}\n{axes}end_header\n"
    text = ply.format("ascii", ROWS) + "\n".join(" ".join(map(str, row)) for row in position.tolist()) + "\n"
    binary = ply.format("binary_little_endian", ROWS).encode() + position.astype("<f4").tobytes()
    files |= {"scan.ply": text.encode(), "scan binary.ply": binary, "rsi.log": _rsi_log(position).encode()}
    files |= {"a_KRCIpo.dat": _trace_head().encode(), "a_KRCIpo.r64": position.astype("<f8").tobytes()}
    return files


def _rsi_log(position: np.ndarray) -> str:  # type: ignore[type-arg]
    telegram = (
        '<Rob Type="KUKA"><RIst X="{0:.4f}" Y="{1:.4f}" Z="{2:.4f}" A="0" B="0" C="0"/>'
        '<RSol X="{0:.4f}" Y="{1:.4f}" Z="{2:.4f}" A="0" B="0" C="0"/>'
        '<AIPos A1="10" A2="-70" A3="95" A4="12" A5="-40" A6="30"/><Delay D="0"/><IPOC>{3}</IPOC></Rob>'
        '<Sen Type="ImFree"><RKorr X="0.1" Y="0" Z="0" A="0" B="0" C="0"/><IPOC>{3}</IPOC></Sen>'
    )
    return "\n".join(telegram.format(*row, 5000 + 12 * k) for k, row in enumerate(position.tolist()))


def _trace_head() -> str:
    lines = ["DIAEXTENDED  {@:ENGLISH", "#BEGINGLOBALHEADER", "102,KR 300", "#ENDGLOBALHEADER"]
    lines += [
        "#BEGINCHANNELHEADER",
        "200,Zeit",
        "202,s",
        "210,IMPLIZIT",
        f"220,{ROWS}",
        "240,0",
        "241,0.012",
        "#ENDCHANNELHEADER",
    ]
    for number, axis in enumerate("XYZ", start=1):
        lines += [
            "#BEGINCHANNELHEADER",
            f"200,{axis}_CmdIpo",
            "202,mm",
            "210,EXPLIZIT",
            "211,a_KRCIpo.r64",
            "213,BLOCK",
            "214,REAL64",
            f"220,{ROWS}",
            f"221,{number}",
            "240,0",
            "241,1",
            "#ENDCHANNELHEADER",
        ]
    return "\r\n".join(lines) + "\r\n"


def _chosen(rng: np.random.Generator, files: Files) -> Files:
    """Return the files of a run: one for the controller, and some beside."""
    one = str(rng.choice(["controller.csv", "controller.parquet", "rsi.log", "a_KRCIpo.dat", "none"]))
    names = [one] if one in files else []
    if one == "a_KRCIpo.dat":
        names.append("a_KRCIpo.r64")
    for table in ("tracker", "force", "scan"):
        endings = (
            (".csv", ".parquet", "") if table != "scan" else (".csv", ".parquet", ".ply", " binary.ply", "")
        )
        ending = str(rng.choice(endings))
        if ending:
            names.append(f"{table}{ending}")
    if not names:
        names = ["tracker.csv"]
    return {name.replace(" binary", ""): files[name] for name in names}


def damage(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Damage the bytes of one file."""
    name, other = str(rng.choice(sorted(chosen))), str(rng.choice(sorted(files)))
    (folder / name).write_bytes(mutated(rng, chosen[name], files[other]))
    return f"bytes of {name}"


def footer(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Change numbers in the footer of a Parquet table."""
    name = str(rng.choice([name for name in files if name.endswith(".parquet")]))
    data = bytearray(files[name])
    length = int.from_bytes(data[-8:-4], "little")
    for _ in range(int(rng.integers(1, 4))):
        at = len(data) - 8 - length + int(rng.integers(length + 4))
        size = int(rng.integers(1, 10))
        data[at : at + size] = bytes(rng.choice([0xFF, 0x80, 0x00, 0x7F, 0xFE], size).astype(np.uint8))
    (folder / name).with_suffix(".csv").unlink(missing_ok=True)
    (folder / name).write_bytes(bytes(data))
    return f"footer of {name}"


def cells(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Replace cells, names or separators of a CSV, or numbers of a text."""
    name = str(rng.choice([n for n in files if n.endswith((".csv", ".log", ".dat")) or n == "scan.ply"]))
    words = re.split(r"([,\n\" ])", files[name].decode("utf-8"))
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(min(len(words), 40))) if rng.random() < 0.3 else int(rng.integers(len(words)))
        words[at] = CELLS[int(rng.integers(len(CELLS)))]
    text = "".join(words)
    if rng.random() < 0.1:
        text = text.replace(",", str(rng.choice([";", "\t", " "])))
    for beside in (".csv", ".parquet", ".ply"):
        (folder / name).with_suffix(beside).unlink(missing_ok=True)
    if name.endswith(".dat"):
        (folder / "a_KRCIpo.r64").write_bytes(files["a_KRCIpo.r64"])
    (folder / name).write_bytes(text.encode(str(rng.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16"]))))
    return f"cells of {name}"


def head(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Change run.toml."""
    lines = HEAD.splitlines()
    key, value = KEYS[int(rng.integers(len(KEYS)))], VALUES[int(rng.integers(len(VALUES)))]
    kind = int(rng.integers(4))
    if kind == 0:
        lines = [f"{key} = {value}", *lines]
    elif kind == 1:
        at = int(rng.integers(len(lines)))
        lines[at] = re.sub(r"= .*", lambda match: f"= {value}", lines[at])
    elif kind == 2:
        lines = [DEPTHS[int(rng.integers(len(DEPTHS)))], *lines]
    else:
        (folder / "run.toml").write_bytes(mutated(rng, HEAD.encode()))
        return "bytes of run.toml"
    (folder / "run.toml").write_text("\n".join(lines), encoding="utf-8")
    return "run.toml"


def table(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Write a whole Parquet table of odd columns."""
    import polars as pl

    name = str(rng.choice(["controller", "tracker", "force", "scan"]))
    frame = pl.read_parquet(io.BytesIO(files[f"{name}.parquet"]))
    column = str(rng.choice(frame.columns))
    kind = int(rng.integers(6))
    if kind == 0:
        kinds = (
            pl.String,
            pl.Int8,
            pl.Boolean,
            pl.Date,
            pl.List(pl.Float64),
            pl.Binary,
            pl.Null,
            pl.Datetime,
        )
        frame = frame.with_columns(pl.lit(None).cast(kinds[int(rng.integers(len(kinds)))]).alias(column))
    elif kind == 1:
        frame = frame.with_columns(pl.Series(column, ["x"] * frame.height))
    elif kind == 2:
        frame = frame.head(int(rng.integers(0, 12)))
    elif kind == 3:
        odd = [np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0, None]
        values = frame[column].to_list()
        for _ in range(int(rng.integers(1, 60))):
            values[int(rng.integers(len(values)))] = odd[int(rng.integers(len(odd)))]
        frame = frame.with_columns(pl.Series(column, values, dtype=pl.Float64))
    elif kind == 4:
        frame = frame.with_columns(pl.col(column) * float(rng.choice([1e300, 0.0, -1.0, 1e-3, 25.4])))
    else:
        frame = frame.rename({column: str(rng.choice(["", " ", "a" * 3000, column + " ", "é"]))})
    for ending in (".csv", ".ply"):
        (folder / f"{name}{ending}").unlink(missing_ok=True)
    for other in ("rsi.log", "a_KRCIpo.dat") if name == "controller" else ():
        (folder / other).unlink(missing_ok=True)
    frame.write_parquet(folder / f"{name}.parquet")
    return f"table {name}, {kind}"


def odd_folder(rng: np.random.Generator, folder: Path, chosen: Files, files: Files) -> str:
    """Remove, empty, double or make a folder of a file."""
    name, kind = str(rng.choice([*sorted(chosen), "run.toml"])), int(rng.integers(4))
    if kind == 0:
        (folder / name).unlink()
    elif kind == 1:
        (folder / name).write_bytes(b"")
    elif kind == 2:
        (folder / name).unlink()
        (folder / name).mkdir()
    else:
        (folder / name).write_bytes(files[str(rng.choice(sorted(files)))])
    return f"folder, {name}"


CASES: tuple[Callable[[np.random.Generator, Path, Files, Files], str], ...] = (
    damage,
    damage,
    footer,
    cells,
    cells,
    head,
    table,
    odd_folder,
)
main = main_of("run folders", prepare, __doc__, 10_000)

if __name__ == "__main__":
    sys.exit(main())

"""Damaged and made-up prediction folders.

python benchmarks/fuzz_predictions.py --count 10000 --seed 1
"""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
from fuzz_common import Try, main_of, mutated

PART = (
    "G21 G90\nT1 M6\nS9000 M3\nM8\nG0 G43 H1 Z30\nX0 Y0\nG1 Z-2 F600\nX20 F1500\nY10\nG2 X30 Y20 I10 J0\n"
    "G4 P0.5\nG0 Z30\nM9\nM30\n"
)
TABLES = ("toolpath", "targets", "motion")
NUMBERS = (
    "-1",
    "0",
    "1e308",
    "nan",
    "inf",
    "-inf",
    "99999999999999999999",
    "true",
    '"text"',
    "[]",
    "{}",
    "-0.0",
    "2147483648",
    "1979-05-27",
    "[[[[1]]]]",
    '"' + "x" * 5000 + '"',
)
DEPTHS = ("[" * 100_000, "{a=" * 20_000, "a." * 20_000 + "a=1", "[a" + ".a" * 20_000 + "]", "\x00", "\ufeff")


def prepare(place: Path) -> Try:
    """Make a good prediction once; return the function that tries a case."""
    from gcode2krl import Prediction, predict

    part = place / "part.nc"
    part.write_text(PART, encoding="ascii")
    good = place / "good"
    predict(part, dt_s=0.05).save(good)
    files = {file.name: file.read_bytes() for file in good.iterdir()}
    folder = place / "case"

    def attempt(rng: np.random.Generator, _: Path) -> str:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir()
        for name, data in files.items():
            (folder / name).write_bytes(data)
        kinds = (
            damage_file,
            damage_record,
            damage_table,
            damage_table,
            damage_footer,
            damage_folder,
            random_file,
        )
        what = kinds[int(rng.integers(len(kinds)))](rng, folder, files)
        loaded = Prediction.load(folder)
        _used(loaded)
        return what

    return attempt


def _used(prediction: object) -> None:
    """Read everything that a command reads."""
    from gcode2krl import Prediction

    assert isinstance(prediction, Prediction)
    for issue in prediction.issues:
        issue.text("part.nc")
    if prediction.motion is not None:
        prediction.toolpath.source_line[prediction.motion.move].max()
        for number in np.unique(prediction.motion.tool):
            prediction.cell.tool_matrix(int(number))
    for event in prediction.toolpath.events:
        assert 0 <= event.row < len(prediction.toolpath)
        assert event.values["line"] >= 0


def damage_file(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Damage the bytes of one file."""
    name, other = rng.choice(sorted(files), 2)
    (folder / str(name)).write_bytes(mutated(rng, files[str(name)], files[str(other)]))
    return f"bytes of {name}"


def damage_record(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Change, delete, double a line of prediction.toml, or one of its values, or nest it deeply."""
    lines = files["prediction.toml"].decode("utf-8").splitlines()
    kind, at = int(rng.integers(6)), int(rng.integers(len(lines)))
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines[at:at] = [lines[int(rng.integers(len(lines)))]]
    elif kind == 2:
        lines[at] = DEPTHS[int(rng.integers(len(DEPTHS)))]
    else:  # another value
        value = NUMBERS[int(rng.integers(len(NUMBERS)))]
        lines[at] = re.sub(r"= [^{,\[]+?(?=[,}]|$)", lambda match: f"= {value} ", lines[at], count=1)
    (folder / "prediction.toml").write_text("\n".join(lines), encoding="utf-8")
    return "prediction.toml"


def damage_table(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Write a whole Parquet table that is not the right one: other values, types, counts, names."""
    import polars as pl

    name = str(rng.choice(TABLES))
    frame = pl.read_parquet(folder / f"{name}.parquet")
    column = str(rng.choice(frame.columns))
    kind = int(rng.integers(10))
    if kind == 0:
        frame = frame.drop(column)
    elif kind == 1:
        frame = frame.head(int(rng.integers(0, frame.height)))
    elif kind == 2:
        free = [
            n for n in ("a", "phi_0_rad", "phi_9_rad", "q1_act_rad", column * 2) if n not in frame.columns
        ]
        frame = frame.rename({column: str(rng.choice(free))})
    elif kind == 3:
        kinds = (
            pl.String,
            pl.Float32,
            pl.Int64,
            pl.UInt32,
            pl.Boolean,
            pl.Int8,
            pl.Date,
            pl.List(pl.Float64),
        )
        frame = frame.with_columns(pl.lit(None).cast(kinds[int(rng.integers(len(kinds)))]).alias(column))
    elif kind == 4:
        frame = frame.reverse()
    elif kind == 5:
        frame = pl.concat([frame] * int(rng.integers(2, 4)))
    elif kind == 6:
        other = str(rng.choice([name for name in frame.columns if name != column]))
        frame = frame.with_columns(pl.col(other).alias(column), pl.col(column).alias(other))
    elif kind == 7:
        frame = pl.DataFrame({"a": [1]})
    else:
        frame = _absurd(rng, frame, column)
    frame.write_parquet(
        folder / f"{name}.parquet", compression=str(rng.choice(["zstd", "snappy", "uncompressed"]))
    )
    return f"table {name}, {kind}"


def _absurd(rng: np.random.Generator, frame: object, column: str) -> object:
    """Put one value into a column that does not belong there."""
    import polars as pl

    assert isinstance(frame, pl.DataFrame)
    values = frame[column].to_list()
    if values:
        kind = frame[column].dtype
        choices = {pl.Float64: [np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0], pl.Boolean: [True, None]}
        choice = choices.get(kind, [-1, 2**31 - 1, -(2**31), 99, None])
        values[int(rng.integers(len(values)))] = choice[int(rng.integers(len(choice)))]
    return frame.with_columns(pl.Series(column, values, dtype=frame[column].dtype))


def damage_footer(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Change numbers in the footer of a table: counts, offsets, sizes, lengths."""
    name = f"{rng.choice(TABLES)}.parquet"
    data = bytearray(files[name])
    length = int.from_bytes(data[-8:-4], "little")
    start = len(data) - 8 - length
    for _ in range(int(rng.integers(1, 4))):
        at = start + int(rng.integers(length + 4))
        size = int(rng.integers(1, 10))
        data[at : at + size] = bytes(rng.choice([0xFF, 0x80, 0x00, 0x7F, 0xFE], size).astype(np.uint8))
    if rng.random() < 0.3:
        data[-8:-4] = int(rng.integers(0, 2**32)).to_bytes(4, "little")
    (folder / name).write_bytes(bytes(data))
    return f"footer of {name}"


def damage_folder(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Remove a file, swap two, make one a folder."""
    one, other = (str(name) for name in rng.choice(sorted(files), 2, replace=False))
    kind = int(rng.integers(3))
    (folder / one).unlink()
    if kind == 1:
        (folder / one).write_bytes(files[other])
    elif kind == 2:
        (folder / one).mkdir()
    return f"folder, {one}"


def random_file(rng: np.random.Generator, folder: Path, files: dict[str, bytes]) -> str:
    """Put random bytes between the magic words."""
    name = f"{rng.choice(TABLES)}.parquet"
    body = rng.bytes(int(rng.integers(0, 400)))
    length = int(rng.choice([len(body), 0, 8, 2**31 - 1, 2**32 - 1])).to_bytes(4, "little")
    (folder / name).write_bytes(b"PAR1" + body + length + b"PAR1")
    return "random bytes"


main = main_of("prediction folders", prepare, __doc__, 10_000)

if __name__ == "__main__":
    sys.exit(main())

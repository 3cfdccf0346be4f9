"""An RSI log → the columns of ``controller.csv``: telegrams as text, or a CSV of their elements.

``RSol`` and ``ASPos`` are commanded and do not include a correction, ``RIst`` and ``AIPos``
are actual; ``RKorr`` and ``AKorr`` of the answers (``Sen``) go to the telegram of the same IPOC. IPOC counts
milliseconds. Telegrams are read with our own pattern: no entities, no nesting, at most 16 kB each.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.runs.tables import Sheet, read_sheet
from gcode2krl.units import MS_PER_S

_LONGEST_TELEGRAM = 16384
_LARGEST_LOG = 1_000_000_000
_ELEMENT = re.compile(rb"<(\w{1,32})((?:\s+\w{1,32}\s*=\s*\"[^\"<>]{0,64}\")+)\s*/?>")
_ATTRIBUTE = re.compile(rb"(\w{1,32})\s*=\s*\"([^\"<>]{0,64})\"")
_IPOC = re.compile(rb"<IPOC>\s*(\d{1,18})\s*</?IPOC>")
_START = re.compile(rb"<(Rob|Sen)[\s>]")
_AXES = {f"a{number}": number for number in range(1, 7)}
_POSES = {"rsol": "cmd", "rist": "act", "rkorr": "corr"}
_JOINTS = {"aspos": "q{}_cmd_deg", "aipos": "q{}_act_deg", "akorr": "q{}_corr_deg", "macur": "i{}_A"}
_ELEMENTS = (*_POSES, *_JOINTS)
_RESETS_MS = 60_000


def is_rsi_log(file: Path) -> bool:
    """Tell whether a file is a log of RSI telegrams, or a CSV of their elements."""
    try:
        with file.open("rb") as stream:
            head = stream.read(65536)
    except OSError:
        return False
    line = head.partition(b"\n")[0]
    named = {_column(word) for word in re.split(rb"[,;\t]", line)}
    return _START.search(head) is not None or (b"ipoc" in line.lower() and len(named) > 1)


def is_telegrams(file: Path) -> bool:
    """Tell whether a file holds RSI telegrams as they were sent."""
    with file.open("rb") as stream:
        return _START.search(stream.read(65536)) is not None


def read_rsi_log(path: str | Path) -> Sheet:
    """Read a log; telegrams that cannot be read are dropped and counted.

    Raises `NotUnderstoodError` naming the file: unreadable, no telegrams, IPOC that falls.
    """
    file = Path(path)
    try:
        if file.stat().st_size > _LARGEST_LOG:
            raise _wrong(file, "larger than 1 GB", "cut the log to the run")
        return _from_telegrams(file) if is_telegrams(file) else _from_csv(file)
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None


def _from_telegrams(file: Path) -> Sheet:
    rows: dict[int, dict[str, float]] = {}
    order: list[int] = []
    answers: dict[int, dict[str, float]] = {}
    bad = twice = 0
    for robot, text in _telegrams(file.read_bytes()):
        ipoc, values = _parse(text)
        if ipoc is None or values is None or (robot and not values):
            bad += 1
        elif not robot:
            answers[ipoc] = values
        elif ipoc in rows:
            twice += 1
        else:
            rows[ipoc] = values
            order.append(ipoc)
    if not order:
        raise _wrong(file, f"no telegram can be read ({bad} malformed)", "log <Rob …> … </Rob> as received")
    _refuse_restart(order, file)
    names = sorted({name for values in (*rows.values(), *answers.values()) for name in values})
    columns = {"t_s": np.array([ipoc - order[0] for ipoc in order], dtype=np.float64) / MS_PER_S}
    for name in names:
        cells = (rows[i].get(name, answers.get(i, {}).get(name, np.nan)) for i in order)
        columns[name] = np.fromiter(cells, dtype=np.float64, count=len(order))
    issues = tuple(_findings(file, columns, bad, twice))
    columns.pop("delay", None)
    return Sheet(columns, tuple(columns), 1, str(file), issues)


def _telegrams(data: bytes) -> Iterator[tuple[bool, bytes]]:
    """Yield (is it the robot's, text) of each telegram; one without an end ends where the next begins."""
    starts = [(match.start(), match[1] == b"Rob") for match in _START.finditer(data)]
    ends = [start for start, _ in starts[1:]] + [len(data)]
    for (start, robot), end in zip(starts, ends, strict=True):
        text = data[start : min(end, start + _LONGEST_TELEGRAM)]
        close = text.find(b"</Rob>" if robot else b"</Sen>")
        yield robot, text[:close] if close >= 0 else b""


def _parse(text: bytes) -> tuple[int | None, dict[str, float] | None]:
    """Return IPOC and the values of a telegram, None for what cannot be read."""
    ipoc = _IPOC.search(text)
    values: dict[str, float] = {}
    for element in _ELEMENT.finditer(text):
        tag = element[1].decode("ascii", "replace").casefold()
        if tag not in _ELEMENTS and tag != "delay":
            continue
        for name, value in _ATTRIBUTE.findall(element[2]):
            column = _name(tag, name.decode("ascii", "replace").casefold())
            try:
                if column:
                    values[column] = float(value)
            except ValueError:
                return None, None
    return (int(ipoc[1]) if ipoc else None), values


def _name(tag: str, attribute: str) -> str:
    """Return the column of an attribute, "" if it has none."""
    if tag == "delay":
        return "delay" if attribute == "d" else ""
    if tag in _POSES and attribute in tuple("xyzabc"):
        return f"{attribute}_{_POSES[tag]}_{'mm' if attribute in 'xyz' else 'deg'}"
    if tag in _JOINTS and attribute in _AXES:
        return _JOINTS[tag].format(_AXES[attribute])
    return ""


def _from_csv(file: Path) -> Sheet:
    """Read ``IPOC, RIst_X, …``; other separators are allowed, and text may precede the header."""
    header = _header(file)
    columns_of = {name: _column(name.encode("utf-8", "replace")) for name in header}
    wanted = {name: column for name, column in columns_of.items() if column}
    if "ipoc" not in wanted.values() or len(set(wanted.values())) < 2:
        raise _wrong(file, "no IPOC with RIst, RSol, AIPos or ASPos", "name the columns IPOC, RIst_X …")
    sheet = read_sheet(file, wanted)
    columns = {column: sheet.columns[name] for name, column in wanted.items()}
    ipoc = columns.pop("ipoc")
    known = ipoc[np.isfinite(ipoc)]
    _refuse_restart(known.tolist(), file)
    columns["t_s"] = (ipoc - (known[0] if len(known) else 0.0)) / MS_PER_S
    issues = tuple(_findings(file, columns, 0, 0))
    columns.pop("delay", None)
    others = tuple(name for name in sheet.names if name not in wanted)
    return Sheet(columns, (*columns, *others), sheet.first_row, str(file), issues)


def _header(file: Path) -> list[str]:
    with file.open("rb") as stream:
        line = stream.readline(65536).decode("utf-8-sig", "replace")
    return [word.strip().strip('"') for word in line.split(",")]


def _column(name: bytes) -> str:
    """Return the column that a heading of the CSV means, "" if none."""
    words = re.findall(r"[a-z0-9]+", name.decode("utf-8", "replace").casefold())
    if words and words[-1] == "ipoc":
        return "ipoc"
    return _name(words[-2], words[-1]) if len(words) >= 2 else ""


def _refuse_restart(ipoc: list[int], file: Path) -> None:
    """Raise where IPOC falls, or jumps by more than a minute: several sessions in one log."""
    step = np.diff(np.array(ipoc, dtype=np.float64))
    wrong = np.flatnonzero((step < 0) | (step > _RESETS_MS))
    if len(wrong):
        at = int(wrong[0])
        words = f"telegram {at + 2}: IPOC goes from {ipoc[at]:g} to {ipoc[at + 1]:g}"
        raise _wrong(file, words, "several sessions: cut the log to one run")


def _findings(file: Path, columns: dict[str, Floats], bad: int, twice: int) -> Iterator[Issue]:
    if bad or twice:
        text = f"{file.name}: {bad} telegrams malformed, {twice} duplicated, dropped"
        yield Issue("warning", "rsi-log", 0, text)
    late = columns.get("delay")
    if late is not None and np.nanmax(late, initial=0.0) > np.nanmin(late, initial=np.inf):
        text = f"{file.name}: Delay rises to {np.nanmax(late):g}: answers were late"
        yield Issue("note", "rsi-log", 0, text)
    if any(name.startswith("i") and name.endswith("_A") for name in columns):
        yield Issue("note", "rsi-log", 0, f"{file.name}: MACur is taken as amperes")

    most = max((np.nanmax(np.abs(v), initial=0.0) for n, v in columns.items() if "_corr_" in n), default=0.0)
    if most > 0.0:
        text = f"{file.name}: a correction was on (up to {most:.3g} mm or deg); RSol, ASPos are without it"
        yield Issue("note", "rsi-log", 0, text)


def _wrong(file: Path, message: str, remedy: str) -> NotUnderstoodError:
    return input_error("rsi-log", message, remedy, source=str(file))

"""Whether the moves of a five-axis program make sense on the declared machine, or only on a neighbour of it.

A wrong sign, order, kind, length or unit is a sound cell and another part. What tells it is the program: a
cutter is driven square to its axis (or at one lead) or along it, leaves along it, has one speed under G93,
and stands in the stock; by chance a move does none of that. So the program is read as the declared machine
turns it and as each neighbour does (`_neighbours`), and the moves vote that fit one of the two readings
only. A kind of moves of which neither reading fits a good part has no vote: a wavy surface under a fixed
tilt has none to give.
"""

import math
import re
from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.errors import Issue, Severity
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.rotary import posed
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

if TYPE_CHECKING:  # a cell file costs its library a noticeable start
    from gcode2krl.cell import Cell
    from gcode2krl.cell.sections.machine import Machine

_MOST_MOVES = 300
"""Moves of a kind that are looked at, evenly spread over the program."""
_FIT_RAD = 0.5 * RAD_PER_DEG
"""How exactly square and parallel are meant; chords of a curve and four decimals are better."""
_ROUNDED_MM = 0.002
"""Posts round each end of a move by half of this."""
_LEAD, _MOST_LEAD, _MOST_AT_LEAD = 0.01, 0.6, 0.5
"""Sines of lead angles that are one, the largest that is a lead, and the fraction of moves that has it."""
_SPEED = 0.01
"""Two speeds are one where they differ by this fraction."""
_LEANS = 0.05
"""A move votes for the reading in which it is so much closer to square (as a sine, 3 degrees)."""
_BESIDE_MM = 2.0
"""A tip outside the stock by the tool's radius and this may still cut it."""
_SHARE = 0.4
"""A kind of moves votes where so many fit one of the readings: chance fits a few of a hundred."""
_IN_STOCK, _NOT_IN_STOCK = 0.9, 0.7
"""Fractions of tips in the stock with which a reading is sound, and below which the declared one is not."""
_FEWEST, _RATIO = 3, 4
"""Votes that decide, and how many times those against."""
_AS_GOOD = 0.9
"""Of readings with nearly the votes of the best, the one that differs in the fewest keys is named."""
_METRES = 0.02, 2.0
"""A length of a machine between these was meant in metres: below is what an alignment leaves."""
_PIVOT_STEP_MM, _MOST_PIVOT_MM = 25.0, 800.0
_ALL_FIT = 0.8
"""Fraction of turning moves that do not fit by chance."""
_FEWEST_FOR_UNIT, _FEWEST_ANGLES = 4, 8
"""Different angles, or feeds, from which on a program tells what they mean."""
_MOST_TILT_RAD, _MOST_TURN_RAD = 1.75, 2.0 * math.pi + 0.01
_NEVER_DEG = 360.0
"""A tilt does not go around."""
_KINDS = {1: ("head", "table"), 2: ("head-head", "table-table", "table-head")}
_KINDS_IN_COMMENTS = {
    "table-table": re.compile(rb"\bTABLE ?[-/ ] ?TABLE\b"),
    "head-head": re.compile(rb"\bHEAD ?[-/ ] ?HEAD\b"),
    "table-head": re.compile(rb"\bTABLE ?[-/ ] ?HEAD\b|\bHEAD ?[-/ ] ?TABLE\b"),
}
_TIP_IN_COMMENTS = re.compile(rb"\bR?TCP[MC]?\b[ :=]*(?:CONTROL[ :=]*)?(ON|OFF|YES|NO)\b")
_COMMENT = re.compile(rb"\(([^)\n]*)\)|;([^\n]*)")
_SEE = "compare one block with the machine; predict --plot draws tip and tool axis (axes.png)"


class _Moves(NamedTuple):
    """The moves that are looked at: with turned axes and known ends, by axis words."""

    from_mm: Floats
    to_mm: Floats
    from_deg: Floats
    to_deg: Floats
    offset_mm: Floats
    by_machine: Bools
    """X, Y, Z are the machine's axes."""
    rapid: Bools
    turning: Bools
    time_s: Floats
    tool: Ints
    line: Ints


class _Reading(NamedTuple):
    """A machine, and what the words of the program mean on it."""

    machine: "Machine"
    changes: tuple[tuple[str, str], ...] = ()
    """Keys with other values than declared, as TOML."""
    cost: int = 0
    """How many slips it takes from this one to the declared one."""
    tip: bool | None = None
    """X, Y, Z are the tip; None: as the program and ``tcpm`` say."""
    factor: float = 1.0
    """Of the angles."""

    def only(self, key: str) -> bool:
        """Tell whether this key alone is another."""
        return len(self.changes) == 1 and self.changes[0][0] == key


class _Sense(NamedTuple):
    """What a reading makes of the moves (k,)."""

    tip_mm: Floats
    """(2, k, 3) where the moves begin and end."""
    axis: Floats
    """(2, k, 3)"""
    fits: dict[str, Bools]
    """Kind of moves: those of it that fit."""
    share: dict[str, float]
    """Kind of moves: the fraction that fits."""
    lean: Floats
    """Sine between the way of a turning feed move and the plane across the tool."""


class _Ballot(NamedTuple):
    """Votes between the declared machine and another reading."""

    reading: _Reading
    sense: _Sense
    pro: int
    con: int
    first: int
    """The first move that votes for the other reading."""

    @property
    def lost(self) -> bool:
        """Tell whether the moves doubt the declared machine."""
        return self.pro >= _FEWEST and self.pro >= _RATIO * self.con

    @property
    def open(self) -> bool:
        """Tell whether the moves decide neither way."""
        return not self.lost and not (self.con >= _FEWEST and self.con >= _RATIO * self.pro)


def machine_issues(columns: dict[str, NDArray[Any]], cell: "Cell", head: bytes) -> Iterator[Issue]:
    """Yield where a program doubts the machine that its cell declares.

    ``columns`` are those of the interpreter: positions as programmed, angles in degrees. ``head`` is the
    beginning of the text.
    """
    machine = cell.machine
    if machine is None or not columns["turn"].any():
        return
    said = list(_metres(machine))
    moves = _looked_at(columns)
    if not len(moves.line):
        yield from said
        return
    stock = None if cell.stock is None else cell.stock.box_mm
    box = None
    if stock is not None:
        used = [
            cell.tool[number].diameter_mm for number in np.unique(moves.tool).tolist() if number in cell.tool
        ]
        beside_mm = max(used, default=0.0) / 2.0 + _BESIDE_MM
        box = np.array(stock) + np.array([[-beside_mm], [beside_mm]])
    declared = _sense_of(_Reading(machine), moves, box)
    ballots = []
    for reading in _neighbours(machine, moves):
        sense = _sense_of(reading, moves, box)
        if not _same(declared, sense):
            ballots.append(_Ballot(reading, sense, *_votes(declared, sense, moves, reading)))
    floor_mm = cell.table.z_mm if cell.table is not None else -np.inf if stock is None else stock[0][2]
    said += [*_comments(machine, moves, head), *_from_below(declared, ballots, moves, floor_mm)]
    yield from said or [*_doubted(machine, ballots, moves)] or _untold(machine, ballots)


# --- the program ------------------------------------------------------------------------------------------


def _looked_at(columns: dict[str, NDArray[Any]]) -> _Moves:
    """Return moves with turned axes, evenly out of each kind: leaving, under a fixed tilt, turning."""
    deg, offset = columns["turn"], np.nan_to_num(columns["length_offset_mm"], nan=0.0)
    mode, feed = columns["turn_mode"], ~columns["rapid"]
    usable = columns["known"].all(axis=1) & ~columns["machine"] & (mode != v.TURN_VECTOR)
    turned = np.asarray(deg.any(axis=1))
    both = usable[1:] & usable[:-1] & (offset[1:] == offset[:-1]) & (mode[1:] == mode[:-1])
    both &= turned[1:] | turned[:-1]
    turning = np.asarray((deg[1:] != deg[:-1]).any(axis=1))
    beside_feed = feed[:-1] | np.append(feed[2:], False)
    kinds = (~feed[1:] & beside_feed & ~turning, feed[1:] & ~turning, feed[1:] & turning)
    row = np.sort(np.concatenate([_spread(np.flatnonzero(both & kind)) + 1 for kind in kinds]))
    position = columns["position_mm"]
    return _Moves(
        position[row - 1],
        position[row],
        deg[row - 1],
        deg[row],
        offset[row],
        mode[row] == v.TURN_MACHINE,
        columns["rapid"][row],
        turning[row - 1],
        _time_s(columns, row),
        columns["tool"][row],
        columns["source_line"][row],
    )


def _time_s(columns: dict[str, NDArray[Any]], row: Ints) -> Floats:
    """Return the time (k,) of moves whose block states one, by G93 or by a feed of its own, else NaN."""
    time_s, feed_mm_s = columns["time_s"][row], columns["feed_mm_s"][row]
    by_feed = ~columns["rapid"][row] & (columns["turn_mode"][row] == v.TURN_MACHINE) & (feed_mm_s > 0.0)
    if len(np.unique(feed_mm_s[by_feed])) < max(_FEWEST_ANGLES, 0.5 * np.count_nonzero(by_feed)):
        return np.asarray(time_s)
    way_mm = np.linalg.norm(columns["position_mm"][row] - columns["position_mm"][row - 1], axis=1)
    return np.where(np.isnan(time_s) & by_feed, way_mm / np.where(by_feed, feed_mm_s, 1.0), time_s)


def _spread(rows: Ints) -> Ints:
    if len(rows) <= _MOST_MOVES:
        return rows
    return rows[np.linspace(0, len(rows) - 1, _MOST_MOVES).astype(np.int64)]


# --- the machines -----------------------------------------------------------------------------------------


def _neighbours(machine: "Machine", moves: _Moves) -> Iterator[_Reading]:
    """Yield the readings that a slip in a key or two, or in the unit of the angles, leads away from."""
    by_machine = bool(moves.by_machine.any())
    yield from _other_chains(machine, by_machine)
    if by_machine:
        yield _Reading(machine, (("tcpm", "true"),), 1, tip=True)
    elif machine.tcpm and _has_lengths(machine):
        yield _Reading(machine, (("tcpm", "false"),), 1, tip=False)
    if by_machine and machine.head_axes and machine.pivot_mm is not None:
        for pivot_mm in (
            *np.arange(0.0, _MOST_PIVOT_MM, _PIVOT_STEP_MM).tolist(),
            *_even_pivot_mm(machine, moves),
        ):
            if abs(pivot_mm - machine.pivot_mm) > 5.0:
                yield _changed(machine, 1, pivot_mm=pivot_mm)
    factor = _unit_of_angles(machine, moves)
    if factor != 1.0:
        yield _Reading(machine, (("angles", "radians" if factor > 1.0 else "degrees"),), 1, factor=factor)


def _other_chains(machine: "Machine", by_machine: bool) -> Iterator[_Reading]:
    """Yield other kinds, orders and signs of the axes, up to three slips away."""
    flips = list(product((1, -1), repeat=len(machine.axes)))
    for kind, axes, flip in product(_KINDS[len(machine.axes)], {machine.axes, machine.axes[::-1]}, flips):
        signs = tuple(sign * side for sign, side in zip(machine.signs, flip, strict=True))
        cost = (kind != machine.kind) + (axes != machine.axes) + flip.count(-1)
        reading = _changed(machine, cost, kind=kind, axes=axes, signs=signs)
        known = not by_machine or _has_lengths(reading.machine)
        if 0 < cost <= 3 and known and _idle_axis(reading.machine) is None:
            yield reading


def _changed(machine: "Machine", cost: int, **values: Any) -> _Reading:
    changes = tuple((key, _toml(value)) for key, value in values.items() if value != getattr(machine, key))
    return _Reading(machine.model_copy(update=values), changes, cost)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _even_pivot_mm(machine: "Machine", moves: _Moves) -> Iterator[float]:
    """Yield the pivot length with which the tip's speed is the most even, where blocks state their time."""
    timed = ~moves.rapid & moves.turning & moves.by_machine & (moves.time_s > 0.0)
    if np.count_nonzero(timed) < _FEWEST_ANGLES:
        return
    way, per_mm = (
        tip[1][timed] - tip[0][timed] for tip in (_ends(machine, moves, 0.0), _ends(machine, moves, 1.0))
    )
    per_mm = per_mm - way  # the tip is linear in the length of the lever: eq. 2
    pivots_mm = np.arange(0.0, _MOST_PIVOT_MM, 1.0)
    speed = np.linalg.norm(way + pivots_mm[:, None, None] * per_mm, axis=2) / moves.time_s[timed]
    log_speed = np.log(np.maximum(speed, 1e-6))
    spread = np.abs(log_speed - np.median(log_speed, axis=1, keepdims=True)).mean(axis=1)
    yield float(pivots_mm[np.argmin(spread)])


def _ends(machine: "Machine", moves: _Moves, pivot_mm: float) -> list[Floats]:
    lift_mm = moves.offset_mm + pivot_mm
    up = np.outer(lift_mm, [0.0, 0.0, 1.0])
    ends = ((moves.from_mm, moves.from_deg), (moves.to_mm, moves.to_deg))
    return [posed(machine, place + up, deg, lift_mm)[0] for place, deg in ends]


def _has_lengths(machine: "Machine") -> bool:
    head_known = not machine.head_axes or machine.pivot_mm is not None
    return head_known and (not machine.table_axes or machine.centre_mm is not None)


def _idle_axis(machine: "Machine") -> str | None:
    """Return C where it stands next to the spindle and turns the tool about itself, beside another axis."""
    letters = [letter for letter, _ in (*reversed(machine.table_axes), *machine.head_axes)]
    return "C" if len(letters) > 1 and letters[-1] == "C" else None


def _in_metres(lengths: tuple[float, ...]) -> bool:
    return _METRES[0] <= max(map(abs, lengths)) < _METRES[1]


def _unit_of_angles(machine: "Machine", moves: _Moves) -> float:
    """Return what makes degrees of the angles if they are radians, or were converted twice; else 1."""
    angles = np.concatenate([moves.from_deg, moves.to_deg])
    if len(np.unique(angles[angles != 0.0])) < _FEWEST_FOR_UNIT:
        return 1.0
    most = np.abs(angles).max(axis=0)
    if most[:2].max() <= _MOST_TILT_RAD and (angles % 0.5).any():
        return DEG_PER_RAD
    tilts = [index for index, letter in enumerate("AB") if letter in machine.axes]
    return RAD_PER_DEG if tilts and most[tilts].max() > _NEVER_DEG else 1.0


# --- what a reading makes of the moves --------------------------------------------------------------------


def _sense_of(reading: _Reading, moves: _Moves, box: Any) -> _Sense:
    """Return what a reading makes of the moves; ``box`` (2, 3) is where tips cut, if it is known."""
    machine = reading.machine
    lift_mm = moves.offset_mm + (machine.pivot_mm or 0.0)
    up = np.outer(lift_mm, [0.0, 0.0, 1.0])
    ends = [
        posed(machine, place + up, reading.factor * deg, lift_mm)
        for place, deg in ((moves.from_mm, moves.from_deg), (moves.to_mm, moves.to_deg))
    ]
    by_tip = ~moves.by_machine if reading.tip is None else np.full(len(moves.line), reading.tip)
    tip = np.where(by_tip[:, None], [moves.from_mm, moves.to_mm], [tip for tip, _ in ends])
    axis = np.stack([axis for _, axis in ends])
    way = tip[1] - tip[0]
    way_mm = np.linalg.norm(way, axis=1)
    middle = axis.sum(axis=0)  # across it are the chords of a circle whose axes point to one centre
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-9)
    lead = np.abs(np.einsum("ij,ij->i", way, middle)) / np.maximum(way_mm, 1e-9)
    near = _FIT_RAD + _ROUNDED_MM / np.maximum(way_mm, _ROUNDED_MM)
    along = np.sqrt(np.maximum(1.0 - lead * lead, 0.0)) < near
    straight = along | (lead < near) | (way_mm < 10.0 * _ROUNDED_MM)
    programmed = moves.to_mm - moves.from_mm
    by_z = np.hypot(programmed[:, 0], programmed[:, 1]) < 0.01 * np.abs(programmed[:, 2])
    feed = ~moves.rapid
    turning = feed & moves.turning
    usual, share = _mode(lead[turning], _LEAD)
    at_lead = (np.abs(lead - usual) < _LEAD) & (share >= _MOST_AT_LEAD) & (usual < _MOST_LEAD)
    timed = feed & (moves.time_s > 0.0)
    log_speed = np.log(np.maximum(way_mm, 1e-6) / np.where(timed, moves.time_s, 1.0))
    usual_speed, _ = _mode(log_speed[timed], _SPEED)
    kinds = {  # every program moves along Z: that says nothing of the tool
        "leave": (moves.rapid & ~by_z, along),
        "tilted": (feed & ~moves.turning & ~by_z, straight),
        "turning": (turning, straight),
        "lead": (turning, straight | at_lead),
        "speed": (timed, np.abs(log_speed - usual_speed) < _SPEED),
    }
    if box is not None:
        kinds["stock"] = (feed, ((tip[1] > box[0]) & (tip[1] < box[1])).all(axis=1))
    fits = {kind: of & fit for kind, (of, fit) in kinds.items()}
    shares = {kind: fits[kind].sum() / max(of.sum(), 1) for kind, (of, _) in kinds.items()}
    return _Sense(tip, axis, fits, shares, np.where(turning & ~along, lead, 0.0))


def _mode(values: Floats, width: float) -> tuple[float, float]:
    """Return the value about which most of some lie, and which fraction of them lies there."""
    if len(values) < _FEWEST_ANGLES:
        return np.nan, 0.0
    ordered = np.sort(values)
    count = np.searchsorted(ordered, ordered + width) - np.arange(len(ordered))
    at = int(np.argmax(count))
    return float(ordered[at : at + count[at]].mean()), float(count[at] / len(ordered))


def _same(sense: _Sense, other: _Sense) -> bool:
    moved_mm = np.abs(sense.tip_mm - other.tip_mm).max()
    return bool(moved_mm < 0.01 and np.abs(sense.axis - other.axis).max() < 1e-4)


def _votes(sense: _Sense, other: _Sense, moves: _Moves, reading: _Reading) -> tuple[int, int, int]:
    """Return how many moves fit the other reading alone, how many the declared, the first of the former."""
    pro, con = (np.zeros(len(moves.line), dtype=np.int64) for _ in range(2))
    same_way = np.abs(sense.tip_mm - other.tip_mm).max(axis=(0, 2)) < 0.01
    for kind, fits in sense.fits.items():
        theirs, best = other.fits[kind], max(sense.share[kind], other.share[kind])
        if reading.only("pivot_mm") and kind not in ("stock", "speed"):
            continue  # a longer lever makes longer ways, which seem squarer
        if best < {"leave": 0.0, "stock": _IN_STOCK}.get(kind, _SHARE):
            continue
        may = same_way if kind == "lead" else np.True_
        con += may & fits & ~theirs
        if kind != "stock" or sense.share[kind] < _NOT_IN_STOCK:
            pro += may & theirs & ~(sense.fits["lead"] if kind == "turning" else fits)
    pro += same_way & (other.lean < sense.lean - _LEANS)
    con += same_way & (sense.lean < other.lean - _LEANS)
    if reading.factor != 1.0:  # a tool that hardly tilts is square to every level way
        way = np.abs(sense.tip_mm[1] - sense.tip_mm[0])
        level = way[:, 2] < _LEANS * way.max(axis=1)
        pro[level] = con[level] = 0
    better = pro > con
    return int(np.count_nonzero(better)), int(np.count_nonzero(con > pro)), int(np.argmax(better))


# --- what is said of it -----------------------------------------------------------------------------------


def _metres(machine: "Machine") -> Iterator[Issue]:
    """Yield lengths of the machine that were meant in metres."""
    lengths = {"pivot_mm": machine.pivot_mm and (machine.pivot_mm,), "centre_mm": machine.centre_mm}
    for key, values in lengths.items():
        if values and _in_metres(values):
            said = ", ".join(f"{value:g}" for value in values)
            words = f"machine.{key} = {said}: no machine is so small, this looks like metres"
            yield Issue("warning", "machine-doubtful", 0, words, "state it in mm", key=f"machine.{key}")


def _comments(machine: "Machine", moves: _Moves, head: bytes) -> Iterator[Issue]:
    """Yield where comments at the beginning name another kind of machine, or what X, Y, Z are."""
    for comment in _COMMENT.finditer(head.upper()):
        text, line = comment[1] or comment[2] or b"", head.count(b"\n", 0, comment.start()) + 1
        kinds = {kind for kind, words in _KINDS_IN_COMMENTS.items() if words.search(text)}
        if kinds and machine.kind not in kinds:
            values = f'"{min(kinds)}", the cell declares "{machine.kind}"'
            yield _doubt(line, f"a comment says that machine.kind is {values}", "kind")
        tip = _TIP_IN_COMMENTS.search(text)
        if tip is None:
            continue
        is_on = tip[1] in (b"ON", b"YES")
        if is_on and moves.by_machine.any():
            words = (
                "a comment says that the tip is programmed, but machine.tcpm is false and no G43.4 in force"
            )
            yield _doubt(line, words, "tcpm")
        if not is_on and machine.tcpm:
            yield _doubt(line, "a comment says that TCP is off, but machine.tcpm is true", "tcpm")


def _from_below(sense: _Sense, ballots: list[_Ballot], moves: _Moves, floor_mm: float) -> Iterator[Issue]:
    """Yield an error where a cutting tool would reach up through what the part stands on."""
    below = _below(sense, moves, floor_mm)
    if not below.any():
        return
    row = int(np.argmax(below))
    x, y, z = sense.axis[1, row]
    words = f"the tool axis ({x:.2f}, {y:.2f}, {z:.2f}) has the holder below the part, at Z {floor_mm:g}"
    key = ""
    best = _best([ballot for ballot in ballots if not _below(ballot.sense, moves, floor_mm).any()])
    if best:
        words += f"; not so with {_named(best)}"
        key = f"machine.{best[0].reading.changes[0][0]}"
    yield Issue("error", "machine-doubtful", int(moves.line[row]), words, _SEE, key=key)


def _best(ballots: list[_Ballot]) -> list[_Ballot]:
    """Return the reading that makes most sense, the fewest slips away, with those of the same effect."""
    most = max((ballot.pro - ballot.con for ballot in ballots), default=0)
    good = [ballot for ballot in ballots if ballot.pro - ballot.con >= _AS_GOOD * most]
    if not good:
        return []
    best = min(good, key=lambda ballot: (ballot.reading.cost, _against_iso(ballot.reading.machine)))
    return [
        ballot
        for ballot in good
        if ballot.reading.cost == best.reading.cost and _same(best.sense, ballot.sense)
    ]


def _below(sense: _Sense, moves: _Moves, floor_mm: float) -> Bools:
    holder_mm = sense.tip_mm[1, :, 2] + moves.offset_mm * sense.axis[1, :, 2]
    return np.asarray(~moves.rapid & (moves.offset_mm > 0.0) & (holder_mm < floor_mm))


def _doubted(machine: "Machine", ballots: list[_Ballot], moves: _Moves) -> Iterator[Issue]:
    """Yield the reading that makes more sense than the declared one, or that an axis does nothing."""
    best = _best([ballot for ballot in ballots if ballot.lost])
    by_unit = [ballot for ballot in ballots if ballot.reading.only("angles") and _other_unit(ballot, moves)]
    idle = _idle_axis(machine)
    turned = idle is not None and bool(np.ptp(moves.to_deg[:, ord("C") - ord("A")]) > 1.0)
    if by_unit:
        yield _of_unit(machine, by_unit[0].reading, moves)
    elif best:
        yield _of_best(machine, best, moves, "error" if turned else "warning")
    elif turned:
        order = f"machine.axes = {_toml(machine.axes)} of kind {_toml(machine.kind)}"
        words = f"{order}: C only turns the tool about itself, so that its words turn nothing"
        remedy = "exchange the axes, or correct machine.kind: " + _SEE
        yield Issue("error", "machine-doubtful", int(moves.line[0]), words, remedy, key="machine.axes")


def _other_unit(ballot: _Ballot, moves: _Moves) -> bool:
    """Tell whether angles have another unit, also where no move says so: a tool that hardly tilts fits."""
    if ballot.lost or not ballot.open:
        return ballot.lost
    angles = np.unique(np.abs([moves.from_deg, moves.to_deg]))
    small = len(angles) > _FEWEST_ANGLES and angles[-1] <= _MOST_TURN_RAD
    around = "C" in ballot.reading.machine.axes and ballot.sense.share["turning"] >= _ALL_FIT
    return ballot.reading.factor > 1.0 and bool(small or around)


def _of_best(machine: "Machine", best: list[_Ballot], moves: _Moves, severity: Severity) -> Issue:
    ballot = best[0]
    keys = dict.fromkeys(key for other in best for key, _ in other.reading.changes)
    declared = " and ".join(f"machine.{key} = {_toml(getattr(machine, key))}" for key in keys)
    about = "about " if ballot.reading.only("pivot_mm") else ""
    words = (
        f"{declared} makes less sense than {about}{_named(best)}: {ballot.pro} of {len(moves.line)} moves go "
        f"square to the tool, along it, evenly or in the stock only with the latter, "
        f"{ballot.con} only as declared"
    )
    key = f"machine.{ballot.reading.changes[0][0]}"
    return Issue(severity, "machine-doubtful", int(moves.line[ballot.first]), words, _SEE, key=key)


def _named(ballots: list[_Ballot]) -> str:
    readings = (ballot.reading for ballot in ballots)
    return " or ".join(" and ".join(f"{key} = {value}" for key, value in one.changes) for one in readings)


def _of_unit(machine: "Machine", reading: _Reading, moves: _Moves) -> Issue:
    letters = " and ".join(sorted(machine.axes))
    most = max(np.abs(moves.from_deg).max(), np.abs(moves.to_deg).max())
    if reading.factor > 1.0:
        words = f"{letters} look like radians: no angle of the program is larger than {most:.4g}"
    else:
        words = f"{letters} look like degrees that were converted twice: the largest is {most:.0f}"
    return Issue("warning", "machine-doubtful", int(moves.line[0]), words, "let the post write degrees")


def _against_iso(machine: "Machine") -> int:
    """Return how many signs are not those of ISO 841, by which a head turns right-handed and a table left."""
    wrong = [sign != -1 for _, sign in machine.table_axes] + [sign != 1 for _, sign in machine.head_axes]
    return sum(wrong)


def _untold(machine: "Machine", ballots: list[_Ballot]) -> Iterator[Issue]:
    """Yield keys of which the program says nothing: with a warning where ISO 841 has other signs."""
    undecided = [ballot.reading for ballot in ballots if ballot.open]
    of_signs = [reading for reading in undecided if reading.only("signs")]
    usual = min(of_signs, key=lambda reading: _against_iso(reading.machine), default=None)
    if usual is not None and _against_iso(usual.machine) < _against_iso(machine):
        words = (
            f"machine.signs = {_toml(machine.signs)}: no move of the program tells these from "
            f"{_toml(usual.machine.signs)}, and ISO 841 has the latter"
        )
        yield Issue("warning", "machine-untold", 0, words, _SEE, key="machine.signs")
        return
    keys = dict.fromkeys(reading.changes[0][0] for reading in undecided if reading.cost == 1)
    if keys:
        words = f"no move of the program tells whether {', '.join(f'machine.{key}' for key in keys)} is right"
        yield Issue("note", "machine-untold", 0, words, _SEE, key=f"machine.{next(iter(keys))}")


def _doubt(line: int, words: str, key: str) -> Issue:
    return Issue("warning", "machine-doubtful", line, words, _SEE, key=f"machine.{key}")

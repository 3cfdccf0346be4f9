"""Which seed asks for what: kinds of cases, how many of each, and the predictions that all share.

Every kind has its own block of seeds behind the first one, so that asking for more cases never changes those
already done, and a part of the check is the first cases of each kind. Seeds below ``SCORED_FROM`` are for
development and calibration; what is scored starts there.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [each for each in (str(ROOT), str(Path(__file__).parent)) if each not in sys.path]

from gcode2krl import load_cell, predict  # noqa: E402
from gcode2krl.effects import library  # noqa: E402
from tests.plant.cases import has_other_form  # noqa: E402
from tests.plant.confounded import PAIRS  # noqa: E402
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN  # noqa: E402
from tests.plant.kinds import STORIES  # noqa: E402
from tests.plant.scene import CELL_TOML  # noqa: E402
from tests.plant.waypoints import PROGRAMS  # noqa: E402

SCORED_FROM = 30_000
BLOCK = 1_000
NULLS = ("null", "null_foreign_noise", "null_foreign_mismatch")
KINDS = ("null", "single", "slip", "open", "pair", "deleted", *NULLS[1:], "confounded", "missing", "story")
"""The n-th kind has the n-th block of seeds."""
MIXED = {"null": 0.12, "single": 0.40, "slip": 0.06, "open": 0.12, "pair": 0.07, "deleted": 0.08}
MIXED |= {"null_foreign_noise": 0.05, "null_foreign_mismatch": 0.04, "confounded": 0.03, "missing": 0.03}
MIXED |= {"story": 0.02}
FULL = {"null": 300, "null_foreign_noise": 100, "null_foreign_mismatch": 100, "single": 600, "pair": 220}
FULL |= {"open": 500, "slip": 54, "confounded": 60, "missing": 60, "story": 60}
ALIKE = ("servo_lag", "dead_time", "servo_gain", "backlash")
"""Effects that six synchronised servos or gears have alike: asked for at target `all` too."""
DELETED_EACH = 10
"""Cases of each effect with that effect taken out of the library."""
OTHER_IN_FIVE = 2
"""Of five cases of an effect that has another form, so many have it: a third of all single-effect cases."""


@dataclass(frozen=True)
class Case:
    """One case: its seed, its kind, and what the plant is asked for."""

    seed: int
    kind: str
    effect: str | None
    """None where the kind draws it."""
    form: str | None = None
    without: tuple[str, ...] = ()
    """Effects taken out of the library."""

    @property
    def name(self) -> str:
        """Return the name of its record."""
        return f"{self.kind}-{self.seed:05d}"


OTHER_NUMBERS = {
    "collision": "it leaves a joint that has slipped: in the library that is a step, a second effect",
    "current_limit": "a share of the run's largest acceleration; in the library one limit for all runs",
    "force_steps": "which step is nearest hangs on tenths of a newton; the library never searches for it",
}
"""What the plant states otherwise than the library, and why a name could not be scored."""


def simulated() -> list[str]:
    """Return every effect of the library that the plant can do; slips are no effects of the robot."""
    return sorted(name for name in _effects() if name in LIBRARY and name not in OTHER_NUMBERS)


def not_simulated() -> list[str]:
    """Return the effects of the library that are never asked for: the plant lacks them or their numbers."""
    return sorted(name for name in _effects() if name not in LIBRARY or name in OTHER_NUMBERS)


def _effects() -> list[str]:
    return [name for name, effect in library().items() if effect.kind != "slip"]


def shelves() -> dict[str, list[str]]:
    """Return what each kind takes in turn; the plant draws for kinds that are not here."""
    return {
        "single": [*simulated(), *(f"{name}@all" for name in simulated() if name in ALIKE)],
        "slip": sorted(SLIPS),
        "open": [f"open:{name}" for name in sorted(set(UNKNOWN) - set(library()))],
        "deleted": simulated(),
        "confounded": sorted(PAIRS),
        "story": sorted(STORIES),
    }


def full_counts() -> dict[str, int]:
    """Return how many cases of each kind the whole check has."""
    return FULL | {"deleted": DELETED_EACH * len(simulated())}


def mixed(count: int) -> dict[str, int]:
    """Return how many cases of each kind a mixed check has."""
    counts = {kind: round(share * count) for kind, share in MIXED.items()}
    counts["single"] += count - sum(counts.values())
    return counts


def in_turn(cases: Sequence[Case]) -> list[Case]:
    """Return the cases with their kinds mixed, so that a check that is cut short has some of each."""
    of_kind = Counter(case.kind for case in cases)
    seen: Counter[str] = Counter()
    shares = []
    for case in cases:
        seen[case.kind] += 1
        shares.append(seen[case.kind] / of_kind[case.kind])
    return [case for _, case in sorted(zip(shares, cases, strict=True), key=lambda pair: pair[0])]


def scaled(counts: dict[str, int], scale: float) -> dict[str, int]:
    """Return the counts of a part of a check; at least one case of each kind that has any."""
    return {kind: ceil(scale * count) for kind, count in counts.items()}


def plan(first_seed: int, counts: dict[str, int], effects: Sequence[str] = ()) -> list[Case]:
    """Return the cases of each kind; named effects alone where some are given, every one in turn.

    Raises ValueError where a block overflows, an effect is unknown, or both sorts of seeds mix.
    """
    _check_seeds(first_seed)
    every = shelves()
    known = {name for shelf in every.values() for name in shelf}
    unknown = {name.partition("@")[0] for name in effects} - known
    if unknown:
        raise ValueError(f"no effect {', '.join(sorted(unknown))}; python -m tests.plant.make_cases --list")
    cases: list[Case] = []
    for number, kind in enumerate(KINDS):
        count = counts.get(kind, 0)
        if count > BLOCK:
            raise ValueError(f"{count} cases of kind {kind}: at most {BLOCK}")
        shelf = every.get(kind, [])
        wanted = [name for name in effects if name.partition("@")[0] in shelf] or shelf
        cases += [_case(kind, first_seed + number * BLOCK + i, i, wanted) for i in range(count)]
    return cases


TWINS = {"force_delay": ("clock",), "tool_diameter": ("swapped_tool",), "gravity": ("load",)}
"""What is the same thing under another name, and is taken out of the library with it."""


def _check_seeds(first_seed: int) -> None:
    last = first_seed + len(KINDS) * BLOCK - 1
    if first_seed < SCORED_FROM <= last:
        raise ValueError(
            f"seed {first_seed}: cases would reach seed {last}; calibration stays below {SCORED_FROM}, so "
            f"give at most {SCORED_FROM - len(KINDS) * BLOCK}, or {SCORED_FROM} and more for what is scored"
        )


def _case(kind: str, seed: int, i: int, names: Sequence[str]) -> Case:
    if not names:
        return Case(seed, kind, "none" if kind in NULLS else None)
    name = names[i % len(names)]
    if kind == "single":
        return Case(seed, kind, name, _form(name, i, len(names)))
    if kind == "deleted":
        effect = name.partition("@")[0]
        return Case(seed, kind, name, without=(effect, *TWINS.get(effect, ())))
    return Case(seed, kind, name)


def _form(name: str, i: int, names: int) -> str:
    """Return the form of the i-th single case: both in every round of all effects, another one each round.

    Where all axes have it alike the plant has one form.
    """
    other = (i % names + i // names) % 5 < OTHER_IN_FIVE and has_other_form(name) and "@" not in name
    return "other" if other else "same"


def predictions(folder: Path) -> dict[str, str]:
    """Predict every program of the plant once; returns the folder of each."""
    folder.mkdir(parents=True, exist_ok=True)
    cell_file = folder / "cell.toml"
    cell_file.write_text(CELL_TOML, encoding="utf-8", newline="\n")
    places = {}
    for name, program in PROGRAMS.items():
        place = folder / name
        if not (place / "prediction.toml").exists():
            part = folder / f"{name}.nc"
            part.write_text(program().text(), encoding="utf-8", newline="\n")
            predict(part, load_cell(cell_file)).save(place)
        places[name] = place.resolve().as_posix()
    return places

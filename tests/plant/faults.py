"""Acting effects: found by name, built in a form, brought to a size."""

from dataclasses import dataclass

import numpy as np

from tests.plant import instruments, truth
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN, Draw, Kind
from tests.plant.effects.depends import Depends
from tests.plant.instruments import Instruments
from tests.plant.robot import Run

RATIOS = (0.25, 4.0)  # of an effect's RMS to the noise


@dataclass(frozen=True)
class Fault:
    """One acting effect: its kind and form, and its parameters at a size."""

    kind: Kind
    form: str
    target: str | None
    at: object

    def hooks(self, size: float) -> dict:
        """Hooks at a size."""
        return self.at(size)[1]

    def values(self, size: float) -> dict:
        """Parameters at a size."""
        return self.at(size)[0]

    @property
    def same(self) -> bool:
        """Whether this is the form of the effect's own name."""
        return self.form == self.kind.same.__name__

    @property
    def depends(self) -> Depends:
        """On what this form depends."""
        return self.kind.depends_of(self.form, self.target)


def find(name: str) -> Kind:
    """The kind behind `name` or `open:name`."""
    plain = name.removeprefix("open:")
    shelves = (UNKNOWN,) if name.startswith("open:") else (LIBRARY, SLIPS)
    for shelf in shelves:
        if plain in shelf:
            return shelf[plain]
    known = [*LIBRARY, *SLIPS, *(f"open:{n}" for n in UNKNOWN)]
    raise ValueError(f"no effect {name!r}; known: none, {', '.join(known)}")


def build(name: str, form: str, seed: int) -> Fault:
    """A fault by `name`, `name@target` or `open:name`; form "same" or "other"."""
    name, _, wanted = name.partition("@")
    kind = find(name)
    draw = Draw(seed, wanted or None)
    if form == "other" and kind.others:
        make = kind.others[int(draw.rng.integers(len(kind.others)))]
    elif form in ("same", "other"):
        make = kind.same
    else:
        raise ValueError(f"form {form!r}: allowed are 'same' and 'other'")
    target, at = make(draw)
    return Fault(kind, make.__name__, target, at)


def has_other_form(name: str) -> bool:
    """Whether the plant has another form of the same physics."""
    return bool(find(name.partition("@")[0]).others)


def needs(faults: tuple[Fault, ...]) -> frozenset:
    """Tables without which an effect cannot be seen."""
    table = {"tcp": "tracker", "force": "force", "scan": ""}
    out = set()
    for fault in faults:
        out |= fault.kind.needs | {table.get(fault.kind.signal, "controller")}
        if fault.target in ("tracker", "force", "controller"):
            out.add(fault.target)
        if fault.target in ("q_load", "q_cmd"):
            out |= {"controller", fault.target}
    return frozenset(out)


def clearest(sized: dict[str, dict]) -> str:
    """Signal in which an effect stands out most; commanded signals have no noise and do not count."""
    return max(sized, key=lambda name: sized[name]["ratio"] if name != "joint_commanded" else -1.0)


def ratio_of(kind: Kind, sized: dict[str, dict]) -> float:
    """Ratio of an effect to the noise in the signal it is judged in, or in the best one."""
    if kind.signal in sized:
        return sized[kind.signal]["ratio"]
    return sized[clearest(sized)]["ratio"] if sized else 0.0


def size_for(fault: Fault, ratio: float, luck: float, drive, without: list[Run], how: Instruments) -> float:
    """Size at which the effect has this ratio to the noise, kept within what is plausible.

    `drive(index, size)` drives run `index` with the effect. `luck` in 0 ... 1 picks a size where the ratio
    says nothing or asks for less than is plausible.
    """
    low, high = fault.kind.sizes
    if fault.kind in SLIPS.values():
        return float(low * (high / low) ** luck)
    every = list(range(len(without)))
    rows = every if fault.kind.all_runs else [every[-1] if fault.kind.hours else 0]

    def found(size: float) -> float:
        runs = [drive(i, size) for i in rows]
        if fault.kind.signal == "scan":
            return truth.scan_size(runs, [without[i] for i in rows], how)["ratio"]
        changes = [
            truth.differences(instruments.clean(run, how), instruments.clean(without[i], how))
            for i, run in zip(rows, runs, strict=True)
        ]
        return ratio_of(fault.kind, truth.sizes(changes, how))

    size = np.sqrt(max(low, 0.02 * high) * high)
    for _ in range(2 if fault.kind.all_runs else 1):  # once more where the size need not be linear
        size = min(size * ratio / max(found(size), 1e-9), 4.0 * high)
    if size < low:  # too small to be plausible: a small plausible size instead
        return float(low * min(6.0, high / low) ** luck)
    return float(min(size, high))

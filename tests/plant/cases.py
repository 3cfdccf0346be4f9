"""A case: what is wrong (or not), several measured runs of it, and a label kept apart."""

from pathlib import Path

from tests.plant import folders, labels, plans, writing
from tests.plant.faults import RATIOS, find, has_other_form
from tests.plant.mismatch import BOUNDS
from tests.plant.plans import Options, Plan, draw_effect

__all__ = ["BOUNDS", "RATIOS", "draw_effect", "find", "has_other_form", "line_of", "make_case", "store"]


def make_case(
    seed: int,
    folder: str | Path,
    effect: str | None = None,
    form: str | None = None,
    runs: int = 3,
    predictions: str = "../predictions",
    twist: bool = False,
) -> dict:
    """Write a case, `folder/run-1 …`, and beside it `folder.label.json`; returns the label.

    `effect`: a name, `name@target`, `open:name`, several joined by "+", "none", or None to draw one.
    `form`: "same" or "other" (None: a third are other forms where one exists). `predictions`: where
    `run.toml` says that the predictions lie. `twist`: the load encoders also see the elastic twist.
    """
    options = Options(effect=effect, form=form, runs=runs, twist=twist)
    return store(plans.draw(seed, options), folder, predictions)


def store(plan: Plan, folder: str | Path, predictions: str, more: dict | None = None) -> dict:
    """Drive a plan and write its folder and its label, which gets `more` on top; returns the label."""
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; give a new folder for the case")
    without = [plan.drive(day, []) for day in plan.days]
    sizes = plan.sizes(without)
    hooks = [fault.hooks(size) for fault, size in zip(plan.faults, sizes, strict=True)]
    driven = [plan.drive(day, hooks) for day in plan.days] if hooks else without
    label = labels.label_of(plan, sizes, driven, without) | (more or {})
    folders.write(folder, plan, driven, predictions)
    writing.write_label(folder.with_name(folder.name + ".label.json"), label)
    return label


def line_of(label: dict) -> str:
    """What acts, in a line."""
    names = [f"{e['effect']} {e['target'] or ''} ({e['form']}, {e['ratio']:.2f})" for e in label["effects"]]
    return " + ".join(names) or "none"

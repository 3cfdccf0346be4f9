"""The library of effects: built-in files and those of a user, and effects by name from a text or a cell."""

import difflib
import importlib
import importlib.util
import math
import pkgutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.effects import builtin
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import LINKS, Applied, Effect, Target
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import Parameter, Role
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.prediction import Prediction

# What an effect states, checked for what contradicts itself: a diagnosis relies on it.

_UNITS = {Role.PHASE: "rad", Role.FREQUENCY: "Hz", Role.MOMENT: "s"}
_AT_MOST_ONE = (Role.PHASE, Role.FREQUENCY, Role.MOMENT)


def what_is_wrong(effect: Effect) -> str:
    """Return the first thing that is wrong with an effect, in one line; nothing where it can be used."""
    return next(_findings(effect), "")


def _findings(effect: Effect) -> Iterator[str]:
    if not effect.name.replace("_", "").isalnum():
        yield "its name must be letters, digits and _"
    if not effect.links <= set(LINKS):
        yield f"links: found {', '.join(sorted(effect.links))}, allowed: {', '.join(LINKS)}"
    if len(set(effect.names)) < len(effect.names):
        yield "a parameter stands twice"
    for p in effect.parameters:
        yield from _of_parameter(p)
    components = {name for names in effect.vectors.values() for name in names} | set(effect.direction or ())
    missing = components - set(effect.names)
    if missing:
        yield f"vectors: there is no parameter {', '.join(sorted(missing))}"
    yield from _of_roles(effect)
    yield from _of_mismatch(effect)
    yield from _of_dependence(effect)


def _of_parameter(p: Parameter) -> Iterator[str]:
    if not p.low <= p.start <= p.high:
        yield f"{p.name}: start {p.start:g} is not within {p.low:g} to {p.high:g}"
    if not isinstance(p.role, Role):
        yield f"{p.name}: role: found {p.role!r}, allowed: Role.{', Role.'.join(Role.__members__)}"
        return
    if p.role is Role.SIZE and p.nominal is None:
        yield f"{p.name}: a size needs a nominal value, at which the effect is not there"
    if p.role is not Role.SIZE and p.nominal is not None:
        yield f"{p.name}: a {p.role.value} has no nominal value (nominal=None)"
    if p.unit != _UNITS.get(p.role, p.unit):
        yield f"{p.name}: a {p.role.value} is in {_UNITS[p.role]}, found {p.unit!r}"
    if p.usual is not None and p.role is not Role.SIZE:
        yield f"{p.name}: only a size has a usual bound, it is a {p.role.value}"


def _of_roles(effect: Effect) -> Iterator[str]:
    """Find roles that do not go together: a sine has one amplitude, a vector one length."""
    count = Counter(p.role for p in effect.parameters)
    for role in _AT_MOST_ONE:
        if count[role] > 1:
            yield f"found {count[role]} parameters with Role.{role.name}, allowed: one"
    if count[Role.FREQUENCY] and count[Role.MOMENT]:
        yield "a frequency and a moment cannot be searched together"
    if count[Role.PHASE] and count[Role.SIZE] != 1:
        yield f"a phase needs exactly one size, its amplitude; found {count[Role.SIZE]}"
    direction = effect.direction or ()
    outside = [p.name for p in effect.parameters if p.role is Role.DIRECTION and p.name not in direction]
    if outside:
        yield f"{outside[0]}: has Role.DIRECTION, but the effect's direction does not name it"
    if not direction:
        return
    if count[Role.SIZE] != 1:
        allowed = "components have nominal=None"
        yield f"a direction needs exactly one size, its length; found {count[Role.SIZE]} ({allowed})"
    if count[Role.PHASE]:
        yield "a phase and a direction cannot be fitted together"


def _of_mismatch(effect: Effect) -> Iterator[str]:
    try:
        usual = effect.usual(Mismatch(), duration_s=1.0)
    except Exception as error:  # whatever a user's function raises is an error of that file
        yield f"usual: {type(error).__name__}: {error}"
        return
    unknown = set(usual) - {p.name for p in effect.sizes}
    if unknown:
        yield f"usual: there is no size {', '.join(sorted(unknown))}"
    if effect.is_nuisance and not usual:
        yield "is_nuisance: no size of it has a usual bound"


def _of_dependence(effect: Effect) -> Iterator[str]:
    for name, kind in (("where", Where), ("depends_on", Dependence)):
        stated = getattr(effect, name)
        if not isinstance(stated, frozenset) or not all(isinstance(each, kind) for each in stated):
            allowed = ", ".join(kind.__members__)
            yield f"{name}: found {stated!r}, allowed: a frozenset of {kind.__name__}: {allowed}"


Library = Mapping[str, Effect]
_FORM = 'write it as "backlash:target=A2,gap_deg=0.02"'
_FILE = "docs/effects.md shows a file of one's own"


def library(extra: Iterable[str | Path] = ()) -> dict[str, Effect]:
    """Return all effects by name: the built-in ones and those of the ``.py`` files of some folders.

    A user's file defines ``EFFECT``, an `Effect` or several; its name begins with a letter. Raises an
    input error that names file and line where it cannot be taken.
    """
    known = {effect.name: effect for effect in _builtin()}
    for folder in extra:
        for file in _files_of(Path(folder)):
            for effect in _effects_of(_loaded(file), str(file)):
                if effect.name in known:
                    raise _bad_file(file, f"the name {effect.name!r} is taken", "give it another name")
                known[effect.name] = effect
    return known


def parse(text: str, known: Library, cell: Cell) -> Applied:
    """Return the effect of a text such as ``backlash:target=A2,gap_deg=0.02``.

    A size that is not given has no effect, a shape its typical value. Components of a vector stand between
    slashes, ``direction=0/0/1``. Raises an input error that names what is allowed.
    """
    name, _, values = (part.strip() for part in text.partition(":"))
    target: Target = None
    given: dict[str, Any] = {}
    for item in filter(None, (part.strip() for part in values.split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not equals or not key or not value:
            raise _wrong(text, f"found {item!r}, allowed: key=value", _FORM)
        if key in given or (key == "target" and target is not None):
            raise _wrong(text, f"{key} stands twice", _FORM)
        if key == "target":
            target = value
        else:
            given[key] = [_number(text, key, number) for number in value.split("/")]
    return build(name, target, given, known, cell, where=text)


def from_cell(cell: Cell, known: Library | None = None) -> list[Applied]:
    """Return the effects of the cell file's ``[[effects]]``: name, target, parameters."""
    known = library() if known is None else known
    return [
        build(entry.name, entry.target, entry.parameters, known, cell, where=f"[[effects]] {number}")
        for number, entry in enumerate(cell.effects, start=1)
    ]


def effects_in(prediction: Prediction, known: Library | None = None) -> list[Applied]:
    """Return the effects that a prediction has: those of its cell, then those it was asked for."""
    known = library() if known is None else known
    asked = prediction.inputs.get("effects", ())
    return [*from_cell(prediction.cell, known), *resolve(asked, known, prediction.cell)]


def resolve(effects: Iterable[str | Applied], known: Library, cell: Cell) -> list[Applied]:
    """Return effects given as texts or as they are; texts are read by `parse`."""
    return [parse(effect, known, cell) if isinstance(effect, str) else effect for effect in effects]


def build(
    name: str, target: Target, given: Mapping[str, Any], known: Library, cell: Cell, where: str = ""
) -> Applied:
    """Return an effect at a target with some of its parameters, all checked against what is allowed."""
    where = where or name
    effect = known.get(name)
    if effect is None:
        raise _wrong(where, f"found effect {name!r}, allowed: {', '.join(sorted(known))}", _near(name, known))
    _check_target(where, effect, target, cell)
    effect = effect.at(target)
    values = {p.name: p.unset for p in effect.parameters}
    for key, value in given.items():
        for parameter, number in _components(where, effect, key, value):
            _check_value(where, parameter, number)
            values[parameter.name] = number
    if effect.parameters and not given:
        raise _wrong(where, f"no parameter of {effect.name} is given, it has {_allowed(effect)}", _FORM)
    return Applied(effect, target, values)


def _check_target(where: str, effect: Effect, target: Target, cell: Cell) -> None:
    targets = effect.targets(cell)
    if target in targets:
        return
    reason = effect.why_not(cell, target)
    if reason or not targets:
        raise _wrong(where, reason or f"{effect.name} is not possible in this cell", "")
    if targets == (None,):
        raise _wrong(where, f"found target {target}, but {effect.name} has no target", "leave it out")
    allowed = ", ".join(str(one) for one in targets)
    given = "no target" if target is None else f"target {target!r}"
    raise _wrong(where, f"found {given}, allowed for {effect.name}: {allowed}", f"target={targets[0]}")


def _components(where: str, effect: Effect, key: str, value: Any) -> Iterator[tuple[Parameter, float]]:
    """Yield each parameter that a key stands for with its number; a vector key stands for several."""
    names = (key,) if key in effect.names else effect.vectors.get(key)
    if names is None:
        known = (*effect.names, *effect.vectors)
        raise _wrong(
            where, f"found {key!r}, allowed for {effect.name}: {_allowed(effect)}", _near(key, known)
        )
    numbers = list(_flat(value))
    if len(numbers) != len(names):
        raise _wrong(where, f"{key}: found {len(numbers)} numbers, allowed: {len(names)}", "0/0/1 for three")
    for name, number in zip(names, numbers, strict=True):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise _wrong(where, f"{key}: found {number!r}, allowed: a number", "")
        yield effect.parameter(name), float(number)


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for part in value:
            yield from _flat(part)
    else:
        yield value


def _check_value(where: str, parameter: Parameter, number: float) -> None:
    if math.isfinite(number) and number >= parameter.minimum:
        return
    allowed = "a finite number" if parameter.minimum == -math.inf else f"{parameter.minimum:g} or more"
    typical = f"plausible: {parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()
    raise _wrong(where, f"{parameter.name}: found {number:g}, allowed: {allowed}", typical)


def _number(where: str, key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise _wrong(where, f"{key}: found {text.strip()!r}, allowed: a number", _FORM) from None


def _allowed(effect: Effect) -> str:
    return ", ".join((*effect.names, *effect.vectors)) or "no parameter"


def _near(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean {near[0]}?" if near else ""


def _wrong(where: str, message: str, remedy: str) -> NotUnderstoodError:
    return input_error("effect-wrong", message, remedy, source=f"effect {where!r}")


# Files


def _builtin() -> Iterator[Effect]:
    for module in pkgutil.iter_modules(builtin.__path__):
        yield from _effects_of(importlib.import_module(f"{builtin.__name__}.{module.name}"), module.name)


def _files_of(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise input_error(
            "effects-folder", "is not a folder", "name the folder of your .py files", source=str(folder)
        )
    return sorted(file for file in folder.glob("*.py") if file.stem[0].isalpha())


def _loaded(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"gcode2krl_effect_{file.stem}", file)
    if spec is None or spec.loader is None:
        raise _bad_file(file, "cannot be read as Python", _FILE)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises is an error of that file
        line = error.lineno or 0 if isinstance(error, SyntaxError) else _line_in(file, error)
        raise _bad_file(file, f"{type(error).__name__}: {error}", _FILE, line) from None
    return module


def _line_in(file: Path, error: Exception) -> int:
    """Return the last line of the file that an error passed through, 0 where none."""
    line, step = 0, error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == str(file):
            line = step.tb_lineno
        step = step.tb_next
    return line


def _effects_of(module: ModuleType, source: str) -> Iterator[Effect]:
    """Yield the effects of a file, each checked by `what_is_wrong`."""
    stated = getattr(module, "EFFECT", None)
    for effect in stated if isinstance(stated, tuple | list) else (stated,):
        if not isinstance(effect, Effect):
            kind = "nothing" if effect is None else type(effect).__name__
            raise _bad_file(source, f"EFFECT: found {kind}, allowed: an Effect or several", _FILE)
        wrong = what_is_wrong(effect)
        if wrong:
            raise _bad_file(source, f"effect {effect.name!r}: {wrong}", _FILE)
        yield effect


def _bad_file(file: str | Path, message: str, remedy: str, line: int = 0) -> NotUnderstoodError:
    return input_error("effect-file", message, remedy, line=line, source=str(file))

"""What an effect states, checked for what contradicts itself: a diagnosis relies on it."""

from collections import Counter
from collections.abc import Iterator

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import LINKS, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import Parameter, Role

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

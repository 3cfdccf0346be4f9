"""What carries robot and part: where ``$BASE`` is in the robot root, as the external axes stand.

A chain of frames (KUKA's machine data: ``$ERSYSROOT`` and the transformations of ``$ETn``), each axis along
or about a direction of its own origin::

    $WORLD -> origin(E1) moved by E1 -> … -> $ROBROOT        rails, in the order of their numbers
    $WORLD -> origin(E2) turned by E2 -> … -> $BASE          a tilt and the turntable behind it

Rails and tables are taken as rigid, and as going exactly along or about their axes.
"""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.external import EXTERNAL_NAMES, ExternalAxis, ExternalName
from gcode2krl.units import RAD_PER_DEG

External = Mapping[ExternalName, ExternalAxis]


def rails_of(external: External) -> list[ExternalName]:
    """Return the rails that carry the robot, the one on the floor first."""
    return [name for name in EXTERNAL_NAMES if name in external and external[name].is_rail]


def tables_of(external: External, base_on: ExternalName | None = None) -> list[ExternalName]:
    """Return the tables that carry ``$BASE``, the one on the floor first.

    ``base_on`` names the last of them, by default that of the highest number.
    """
    tables = [name for name in EXTERNAL_NAMES if name in external and not external[name].is_rail]
    if not tables:
        return []
    last = base_on if base_on is not None else tables[-1]
    before = tables[: tables.index(last)]
    tilted = before and external[before[-1]].kind == "tilt"
    return [before[-1], last] if tilted else [last]


def contradictions(external: External, base_on: ExternalName | None = None) -> Iterator[tuple[str, str]]:
    """Yield key and reason where axes are coupled in a way that no ``$BASE`` of the controller expresses."""
    if base_on is not None and (base_on not in external or external[base_on].is_rail):
        return  # a finding of its own
    rails, tables = rails_of(external), tables_of(external, base_on)
    if len({external[name].coupled for name in rails}) > 1:
        yield f"external.{rails[-1]}.coupled", f"all rails alike: {rails[0]} is coupled otherwise"
    if len({external[name].machine_def for name in tables}) > 1:
        words = f"{tables[0]} and {tables[-1]} are one machine: state the same machine_def for both"
        yield f"external.{tables[0]}.machine_def", words
    if rails and tables and not external[rails[0]].coupled and external[tables[-1]].is_coupled:
        words = "false, while a table is coupled: where it stands is stated in $WORLD, which this rail leaves"
        yield f"external.{rails[0]}.coupled", words


def most_of(external: External, what: Literal["speed", "acceleration"]) -> Floats:
    """Return the largest speed or acceleration of E1 to E6 (6,), in mm or degrees; inf where unknown."""
    stated = (getattr(external.get(name), what, None) for name in EXTERNAL_NAMES)
    return np.array([np.inf if most is None else most for most in stated])


def root_in_world(external: External, at: Floats, robroot: Floats) -> Floats:
    """Return the robot root in ``$WORLD`` (n, 4, 4) with E1 to E6 at (n, 6); ``robroot`` on its carriage."""
    frame = np.broadcast_to(np.eye(4), (len(at), 4, 4))
    for name in rails_of(external):
        axis = external[name]
        way = at[:, EXTERNAL_NAMES.index(name), None] * axis.direction()
        frame = frame @ axis.origin_matrix() @ fr.transform(way, np.eye(3))
    return np.asarray(frame @ robroot)


def base_in_world(
    external: External, at: Floats, base: Floats, base_on: ExternalName | None = None
) -> Floats:
    """Return ``$BASE`` in ``$WORLD`` (n, 4, 4) with E1 to E6 at (n, 6); ``base`` on its table."""
    if not external:
        return np.broadcast_to(base + 0.0, (len(at), 4, 4))
    frame = np.broadcast_to(np.eye(4), (len(at), 4, 4))
    for name in tables_of(external, base_on):
        axis = external[name]
        turn = about(axis.direction(), at[:, EXTERNAL_NAMES.index(name)] * RAD_PER_DEG)
        frame = frame @ axis.origin_matrix() @ fr.transform(np.zeros(3), turn)
    return np.asarray(frame @ base)


def about(axis: Floats, angle_rad: Floats) -> Floats:
    """Return right-handed turns (n, 3, 3) about a unit vector (3,), by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angle_rad)[:, None, None], np.cos(angle_rad)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross))

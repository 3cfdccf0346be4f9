"""Readings of a force sensor at the flange without offset, weight and hose pack, transferred to the TCP.

Signs: the sensor states the load on its tool side along its own axes; R is the rotation of the sensor frame S
in the robot root, v_root = R·v_S. With gravity along the unit vector g, weight W and centre r (from the
sensor's origin) a sensor without process force shows (Hähn & Weigold 2020, section 2.6)

    F = W·Rᵀ·g + F_SI + F_app(q),      M = r x (W·Rᵀ·g) + M_SI + M_app(q)

with constant offsets F_SI, M_SI and the remaining offset, F_app, M_app: ten quadratic terms in the
quaternion. The paper's polynomial has 15 (eq. 17), but |q| = 1 makes its constant the sum of the squares and
q = -q, the same orientation, rules out the linear ones. The ten terms span the constant and the nine entries
of R.
"""

from pathlib import Path
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, ValidationError, model_validator

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell import library
from gcode2krl.cell.sections import Finite, Section
from gcode2krl.errors import input_error

Three = tuple[Finite, Finite, Finite]
_PAIRS = ((0, 0), (1, 1), (2, 2), (3, 3), (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_NO_TERMS = ((0.0, 0.0, 0.0),) * 10


class Calibration(Section):
    """What is subtracted from the sensor's reading; along the sensor's axes, moments about its origin."""

    gravity_root: Three = (0.0, 0.0, -1.0)
    """Unit vector downwards in the robot root."""
    weight_N: Finite
    """Weight of everything on the tool side; below 0 where the sensor states the reaction."""
    centre_mm: Three
    """Centre of gravity from the sensor's origin."""
    force_offset_N: Three
    moment_offset_Nmm: Three
    force_terms_N: Annotated[tuple[Three, ...], Field(min_length=10, max_length=10)] = _NO_TERMS
    """F_app: coefficients of x², y², z², w², xy, xz, xw, yz, yw, zw of the sensor's quaternion."""
    moment_terms_Nmm: Annotated[tuple[Three, ...], Field(min_length=10, max_length=10)] = _NO_TERMS
    source: str = ""

    @model_validator(mode="after")
    def _unit_gravity(self) -> Self:
        if abs(np.linalg.norm(self.gravity_root) - 1.0) > 1e-6:
            raise ValueError("gravity_root has not length 1")
        return self


def quadratic_terms(rotation: ArrayLike) -> Floats:
    """Return the ten products (n, 10) of quaternions (n, 4), x, y, z, w; the sign of q does not matter."""
    q = np.atleast_2d(np.asarray(rotation, dtype=float))
    return np.stack([q[:, i] * q[:, j] for i, j in _PAIRS], axis=1)


def unloaded(rotation: ArrayLike, calibration: Calibration) -> tuple[Floats, Floats]:
    """Return force (n, 3) in N and moment (n, 3) in N·mm that the sensor shows without process force.

    Parameters
    ----------
    rotation : (n, 4)
        Unit quaternions x, y, z, w of the sensor frame in the robot root.
    """
    q = np.atleast_2d(np.asarray(rotation, dtype=float))
    down = np.einsum("nji,j->ni", fr.rotation_from_quaternion(q), np.array(calibration.gravity_root))
    weight = calibration.weight_N * down
    terms = quadratic_terms(q)
    force = weight + np.array(calibration.force_offset_N) + terms @ np.array(calibration.force_terms_N)
    moment = np.cross(np.array(calibration.centre_mm), weight) + np.array(calibration.moment_offset_Nmm)
    return force, moment + terms @ np.array(calibration.moment_terms_Nmm)


def compensate(
    force_N: ArrayLike, moment_Nmm: ArrayLike, rotation: ArrayLike, calibration: Calibration
) -> tuple[Floats, Floats]:
    """Return the process load at the sensor: readings minus weight, offset and remaining offset, eq. 18.

    Eq. 18 states the force; the moment follows by the same balance about the sensor's origin.

    Parameters
    ----------
    force_N, moment_Nmm : (n, 3)
        As the sensor states them, along its axes.
    rotation : (n, 4)
        Unit quaternions x, y, z, w of the sensor frame in the robot root; q and -q give the same.
    calibration : Calibration
        See `identify_sensor`. It is valid between the orientations it was measured in; inertia is not
        included.

    Returns
    -------
    force_N, moment_Nmm : (n, 3)
        On the tool side, along the sensor's axes, about its origin.
    """
    own_force, own_moment = unloaded(rotation, calibration)
    force = np.atleast_2d(np.asarray(force_N, dtype=float)) - own_force
    moment = np.atleast_2d(np.asarray(moment_Nmm, dtype=float)) - own_moment
    return force, moment


def transfer_to_tcp(
    force_N: ArrayLike, moment_Nmm: ArrayLike, tcp_in_sensor: ArrayLike
) -> tuple[Floats, Floats]:
    """Return a load at the sensor as one at the TCP, along the axes of the tool frame, eq. 19-20.

    Forces are equal at sensor and TCP (eq. 19); the moment about the TCP is M - p x F. Rigid end effector.

    Parameters
    ----------
    force_N, moment_Nmm : (n, 3)
        Along the sensor's axes, about its origin, see `compensate`.
    tcp_in_sensor : (4, 4)
        The tool frame in the sensor frame; lengths in mm.
    """
    frame = np.asarray(tcp_in_sensor, dtype=float)
    force = np.atleast_2d(np.asarray(force_N, dtype=float))
    moment = np.atleast_2d(np.asarray(moment_Nmm, dtype=float)) - np.cross(frame[:3, 3], force)
    return force @ frame[:3, :3], moment @ frame[:3, :3]  # eq. 20: rows times R are Rᵀ·v


def calibration_toml(calibration: Calibration) -> str:
    """Return a calibration as the text of its TOML file."""
    import tomli_w

    return tomli_w.dumps(calibration.model_dump(mode="json"))


def read_calibration(path: str | Path) -> Calibration:
    """Read a calibration that `gcode2krl identify sensor -o` wrote; raises `NotUnderstoodError`."""
    data = library.read_toml(Path(path))
    try:
        return Calibration.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(step) for step in first["loc"])
        raise input_error(
            "calibration-key",
            f"{key}: found {first['input']!r:.60}, allowed: {first['msg']}",
            "write it with `gcode2krl identify sensor -o`",
            source=str(path),
        ) from None

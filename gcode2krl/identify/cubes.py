"""Measuring cubes: six distances of laser triangulation sensors to the small motion of a cube, and back.

As in Hähn & Weigold 2020, section 2.5: the lasers stand on a frame beside the robot and see three faces of a
cube, here in a 3-2-1 layout (three on one face, two on the next, one on the third), which just determines the
six coordinates of a rigid motion. Points and directions are along the axes of the unloaded cube, whose origin
is its centre. A laser measures how much longer the beam's way to the face has become.
"""

from dataclasses import dataclass

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats

EDGE_MM = 100.0
"""Edge of a measuring cube (section 2.5)."""
POINTS_MM = (
    (-40.0, -40.0, 50.0),
    (40.0, -40.0, 50.0),
    (0.0, 40.0, 50.0),
    (-40.0, 50.0, 0.0),
    (40.0, 50.0, 0.0),
    (50.0, 0.0, 0.0),
)
"""Where the beams hit the unloaded cube: our choice, the paper gives no layout."""
DIRECTIONS = ((0.0, 0.0, -1.0),) * 3 + ((0.0, -1.0, 0.0),) * 2 + ((-1.0, 0.0, 0.0),)
"""Where the beams point: at right angles into the faces."""

_MOST_STEPS = 50
_SETTLED_MM = 1e-10
_WORST_CONDITION = 1e3
_LEVER_MM = 40.0


@dataclass(frozen=True)
class Layout:
    """Six laser beams on a cube."""

    point_mm: Floats
    """(6, 3) where they hit."""
    direction: Floats
    """(6, 3) unit vectors along the beams."""
    normal: Floats
    """(6, 3) outward normals of the faces that they hit."""

    @classmethod
    def of(cls, point_mm: object = POINTS_MM, direction: object = DIRECTIONS) -> "Layout":
        """Return the layout of points (6, 3) and beams (6, 3); a beam hits the face most normal to it."""
        beams = np.array(direction, dtype=float)
        beams /= np.linalg.norm(beams, axis=1, keepdims=True)
        normal = np.zeros((6, 3))
        axis = np.argmax(np.abs(beams), axis=1)
        normal[np.arange(6), axis] = -np.sign(beams[np.arange(6), axis])
        return cls(np.array(point_mm, dtype=float), beams, normal)

    def slope(self) -> Floats:
        """Return the derivative (6, 6) of the distances by the cube's rotation (rad) and translation (mm)."""
        across = np.einsum("ij,ij->i", self.normal, self.direction)[:, None]
        slope: Floats = np.hstack([np.cross(self.point_mm, self.normal), self.normal]) / across
        return slope

    def determines_motion(self) -> bool:
        """Tell whether the six beams determine the six coordinates, with tilts scaled by a lever of 40 mm."""
        scaled = self.slope() / np.array([_LEVER_MM] * 3 + [1.0] * 3)
        return bool(np.linalg.cond(scaled) < _WORST_CONDITION)


def distances(motion: Floats, layout: Layout) -> Floats:
    """Return how much longer the beams' ways (n, 6) in mm are after a cube's motion (n, 4, 4); exact."""
    normal = np.einsum("nij,kj->nki", motion[:, :3, :3], layout.normal)
    point = np.einsum("nij,kj->nki", motion[:, :3, :3], layout.point_mm) + motion[:, None, :3, 3]
    ahead = np.einsum("nki,nki->nk", normal, point - layout.point_mm)
    longer: Floats = ahead / np.einsum("nki,ki->nk", normal, layout.direction)
    return longer


def motion_of(longer_mm: Floats, layout: Layout) -> Floats:
    """Return the motions (n, 4, 4) of a cube from six distances, loaded minus unloaded, (n, 6) in mm.

    The linear solution is refined until the exact distances agree, so the motion need not be tiny; where it
    is too large for this to converge (some tenths of a radian) the row is NaN.
    """
    inverse = np.linalg.inv(layout.slope())
    twist = longer_mm @ inverse.T
    motion = _rigid(twist)
    for _ in range(_MOST_STEPS):
        missing = longer_mm - distances(motion, layout)
        if np.abs(missing).max(initial=0.0) < _SETTLED_MM:
            break
        twist = twist + missing @ inverse.T
        motion = _rigid(twist)
    missing = np.abs(longer_mm - distances(motion, layout)).max(axis=1)
    motion[~(missing < _SETTLED_MM)] = np.nan
    return motion


def motion_covariance(layout: Layout) -> Floats:
    """Return the covariance (6, 6) of a motion (rad, mm) for distances of 1 mm noise, each read twice."""
    inverse = np.linalg.inv(layout.slope())
    covariance: Floats = 2.0 * inverse @ inverse.T
    return covariance


def carried(frame: Floats) -> Floats:
    """Return (n, 6, 6) that takes small motions (rad, mm) along frames (n, 4, 4) to the outer axes."""
    rotation, place = frame[:, :3, :3], frame[:, :3, 3]
    matrix = np.zeros((len(frame), 6, 6))
    matrix[:, :3, :3] = matrix[:, 3:, 3:] = rotation
    matrix[:, 3:, :3] = np.cross(place[:, :, None], rotation, axis=1)
    return matrix


def _rigid(twist: Floats) -> Floats:
    """Return transforms (n, 4, 4) of rotation vectors and translations (n, 6)."""
    angle = np.linalg.norm(twist[:, :3], axis=1, keepdims=True)
    half_sinc = 0.5 * np.sinc(angle / (2.0 * np.pi))
    quaternion = np.hstack([twist[:, :3] * half_sinc, np.cos(0.5 * angle)])
    return fr.transform(twist[:, 3:], fr.rotation_from_quaternion(quaternion))

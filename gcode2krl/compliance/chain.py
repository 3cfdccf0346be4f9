"""The elastic chain of Haehn & Weigold 2020, eq. 1-9: compiled loops over rows of joints and loads.

A frame follows from the one before by T_i = Rx(alpha)·Tx(a)·Tz(d)·Rz(theta) (eq. 1; their Ty(b) is zero on
every frame used here), alpha a multiple of 90 degrees. Frames 1 to 10 carry a virtual joint each; beyond
the tenth everything is rigid, so only the tip matters there. The load is carried outwards into each frame
(eq. 5), then tip, shift and turn are carried inwards, from frame 10 to the root.

Rows are taken in blocks, one array for each quantity, so that each line below is one vector instruction for
several rows. Every row passes through the same operations wherever it is: results do not depend on how
rows are cut into chunks.
"""

import math

import numba
import numpy as np

from gcode2krl.arrays import Floats, Ints32

FRAMES = 10
"""Frames with a virtual joint, in the order of `gcode2krl.cell.sections.VIRTUAL_JOINTS`."""
AXIS_FRAME = (0, 1, 3, 5, 6, 7)
"""The frame that each axis A1 to A6 turns."""
AXIS_SIGN = (-1.0, 1.0, 1.0, -1.0, 1.0, -1.0)
AXIS_ZERO = (0.0, 0.0, -math.pi / 2, 0.0, 0.0, math.pi)
"""theta = AXIS_SIGN·A + AXIS_ZERO, A with the controller's sign and zero."""

BLOCK = 256
TIP, SHIFT, TURN_W, TURN = 0, 3, 6, 7
"""Rows of ``state``: r_i (eq. 2), its change under the load, and the quaternion of R̂_i·R_iᵀ, in frame i."""

QUARTER_HIGH = math.floor(math.pi / 2 * 2**29) / 2**29
"""pi/2 in 30 bits: its product with a small integer is exact (Cody and Waite 1980)."""
QUARTER_LOW = (math.pi / 2 - QUARTER_HIGH) + 6.123233995736766e-17
S3, S5, S7, S9, S11, S13, S15 = (1.0 / math.factorial(k) for k in range(3, 17, 2))
C2, C4, C6, C8, C10, C12, C14, C16 = (1.0 / math.factorial(k) for k in range(2, 17, 2))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def displaced_rows(
    q_rad: Floats,
    force_N: Floats,
    moment_Nmm: Floats,
    frames: Floats,
    softness: Floats,
    base: Floats,
    tips_mm: Floats,
    tool: Ints32,
    shift_mm: Floats,
    turn_rad: Floats,
) -> None:
    """Write how far the tip moves under a load, eq. 2-9.

    ``q_rad`` (n, 6); force and moment (n, 3) at the tip along the axes of ``base``, whose rotation in the
    root is (3, 3); ``frames`` (10, 4) cos alpha, sin alpha, a, d; ``softness`` (10, 3) = 1/k_C, 1/k_B, 1/k_A;
    tip of row i in frame 10 is ``tips_mm[tool[i]]``. Results (n, 3) along ``base``: shift, and rotation
    vector, which is left out where ``turn_rad`` is (0, 3).
    """
    cos, sin = np.ones((FRAMES, BLOCK)), np.zeros((FRAMES, BLOCK))
    load, state = np.zeros((FRAMES + 1, 6, BLOCK)), np.zeros((10, BLOCK))
    for first in range(0, len(q_rad), BLOCK):
        rows = min(BLOCK, len(q_rad) - first)
        _sines(q_rad, first, rows, cos, sin)
        _take_load(force_N, moment_Nmm, base, first, rows, load[0])
        for i in range(FRAMES):
            _carry_load(load[i], frames[i], cos[i], sin[i], load[i + 1])
        _start(tips_mm, tool, first, rows, state)
        for i in range(FRAMES - 1, -1, -1):
            _bend(load[i + 1], softness[i], state)
            _carry_inwards(frames[i], cos[i], sin[i], state)
        _give(state[SHIFT : SHIFT + 3], base, first, rows, shift_mm)
        if len(turn_rad) > 0:
            _rotation_vectors(rows, state)
            _give(state[TURN : TURN + 3], base, first, rows, turn_rad)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def tip_rows(
    q_rad: Floats,
    qd_rad_s: Floats,
    frames: Floats,
    base: Floats,
    tips_mm: Floats,
    tool: Ints32,
    position_mm: Floats,
    velocity_mm_s: Floats,
) -> None:
    """Write where the rigid tip is, seen from the foot of axis 1, and its velocity; see `displaced_rows`."""
    cos, sin = np.ones((FRAMES, BLOCK)), np.zeros((FRAMES, BLOCK))
    rate, state = np.zeros((FRAMES, BLOCK)), np.zeros((10, BLOCK))
    for first in range(0, len(q_rad), BLOCK):
        rows = min(BLOCK, len(q_rad) - first)
        _sines(q_rad, first, rows, cos, sin)
        for axis in range(6):
            for j in range(rows):
                rate[AXIS_FRAME[axis], j] = AXIS_SIGN[axis] * qd_rad_s[first + j, axis]
        _start(tips_mm, tool, first, rows, state)
        for i in range(FRAMES - 1, -1, -1):
            for j in range(BLOCK):  # omega x r, omega along z
                state[SHIFT, j] -= rate[i, j] * state[TIP + 1, j]
                state[SHIFT + 1, j] += rate[i, j] * state[TIP, j]
            _carry_inwards(frames[i], cos[i], sin[i], state)
        _give(state[TIP : TIP + 3], base, first, rows, position_mm)
        _give(state[SHIFT : SHIFT + 3], base, first, rows, velocity_mm_s)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _take_load(
    force_N: Floats, moment_Nmm: Floats, base: Floats, first: int, rows: int, load: Floats
) -> None:
    """Write force and moment along the root's axes."""
    for k in range(3):
        to_x, to_y, to_z = base[k, 0], base[k, 1], base[k, 2]
        for j in range(rows):
            i = first + j
            load[k, j] = to_x * force_N[i, 0] + to_y * force_N[i, 1] + to_z * force_N[i, 2]
            load[k + 3, j] = to_x * moment_Nmm[i, 0] + to_y * moment_Nmm[i, 1] + to_z * moment_Nmm[i, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _start(tips_mm: Floats, tool: Ints32, first: int, rows: int, state: Floats) -> None:
    """Put the tip of each row into frame 10, neither shifted nor turned."""
    state[SHIFT:] = 0.0
    state[TURN_W] = 1.0
    for k in range(3):
        for j in range(rows):
            state[TIP + k, j] = tips_mm[tool[first + j], k]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _give(vector: Floats, base: Floats, first: int, rows: int, out: Floats) -> None:
    """Write vectors (3, BLOCK) along the root's axes as rows along those of ``base``."""
    for k in range(3):
        of_x, of_y, of_z = base[0, k], base[1, k], base[2, k]
        for j in range(rows):
            out[first + j, k] = of_x * vector[0, j] + of_y * vector[1, j] + of_z * vector[2, j]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sines(q_rad: Floats, first: int, rows: int, cos: Floats, sin: Floats) -> None:
    """Write cos and sin of theta for the frames that an axis turns."""
    for axis in range(6):
        cos_i, sin_i = cos[AXIS_FRAME[axis]], sin[AXIS_FRAME[axis]]
        for j in range(rows):
            cos_i[j] = AXIS_SIGN[axis] * q_rad[first + j, axis] + AXIS_ZERO[axis]
        for j in range(BLOCK):
            sin_i[j], cos_i[j] = _sin_cos(cos_i[j])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _carry_load(load: Floats, frame: Floats, cos: Floats, sin: Floats, turned: Floats) -> None:
    """Turn force and moment about the tip into the next frame outwards, eq. 5."""
    cos_alpha, sin_alpha = frame[0], frame[1]
    for k in (0, 3):
        for j in range(BLOCK):
            x = load[k, j]
            y = cos_alpha * load[k + 1, j] + sin_alpha * load[k + 2, j]
            z = cos_alpha * load[k + 2, j] - sin_alpha * load[k + 1, j]
            turned[k, j] = cos[j] * x + sin[j] * y
            turned[k + 1, j] = cos[j] * y - sin[j] * x
            turned[k + 2, j] = z


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _bend(load: Floats, softness: Floats, state: Floats) -> None:
    """Turn everything outside a virtual joint by its elastic rotation R*, eq. 3, 4, 6 and 7.

    The quaternion (w, x, y, z) of R* moves a point p by w·t + v x t, t = 2·v x p, which loses no digits
    however small the angles are.
    """
    half_c, half_b, half_a = 0.5 * softness[0], 0.5 * softness[1], 0.5 * softness[2]
    for j in range(BLOCK):
        rx, ry, rz = state[TIP, j], state[TIP + 1, j], state[TIP + 2, j]
        fx, fy, fz = load[0, j], load[1, j], load[2, j]
        sin_c, cos_c = _sin_cos_near_zero((ry * fz - rz * fy + load[3, j]) * half_c)  # eq. 6, 7
        sin_b, cos_b = _sin_cos_near_zero((rz * fx - rx * fz + load[4, j]) * half_b)
        sin_a, cos_a = _sin_cos_near_zero((rx * fy - ry * fx + load[5, j]) * half_a)
        w = cos_c * cos_b * cos_a + sin_c * sin_b * sin_a  # eq. 4: Rz·Ry·Rx
        x = sin_c * cos_b * cos_a - cos_c * sin_b * sin_a
        y = cos_c * sin_b * cos_a + sin_c * cos_b * sin_a
        z = cos_c * cos_b * sin_a - sin_c * sin_b * cos_a
        px, py, pz = rx + state[SHIFT, j], ry + state[SHIFT + 1, j], rz + state[SHIFT + 2, j]
        tx, ty, tz = 2.0 * (y * pz - z * py), 2.0 * (z * px - x * pz), 2.0 * (x * py - y * px)
        state[SHIFT, j] += w * tx + y * tz - z * ty
        state[SHIFT + 1, j] += w * ty + z * tx - x * tz
        state[SHIFT + 2, j] += w * tz + x * ty - y * tx
        w_before, x_before = state[TURN_W, j], state[TURN, j]
        y_before, z_before = state[TURN + 1, j], state[TURN + 2, j]
        state[TURN_W, j] = w * w_before - x * x_before - y * y_before - z * z_before
        state[TURN, j] = w * x_before + x * w_before + y * z_before - z * y_before
        state[TURN + 1, j] = w * y_before + y * w_before + z * x_before - x * z_before
        state[TURN + 2, j] = w * z_before + z * w_before + x * y_before - y * x_before


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _carry_inwards(frame: Floats, cos: Floats, sin: Floats, state: Floats) -> None:
    """Express tip, shift and turn in the next frame inwards, eq. 1; only the tip is a point."""
    cos_alpha, sin_alpha, a_mm, d_mm = frame[0], frame[1], frame[2], frame[3]
    for k in (TIP, SHIFT, TURN):
        for j in range(BLOCK):
            x = cos[j] * state[k, j] - sin[j] * state[k + 1, j] + a_mm
            y = cos[j] * state[k + 1, j] + sin[j] * state[k, j]
            z = state[k + 2, j] + d_mm
            state[k, j] = x
            state[k + 1, j] = cos_alpha * y - sin_alpha * z
            state[k + 2, j] = cos_alpha * z + sin_alpha * y
        a_mm, d_mm = 0.0, 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _rotation_vectors(rows: int, state: Floats) -> None:
    """Replace the quaternions by rotation vectors: 2·atan(|v|/w)·v/|v|."""
    for j in range(rows):
        w, x, y, z = state[TURN_W, j], state[TURN, j], state[TURN + 1, j], state[TURN + 2, j]
        sine_2 = x * x + y * y + z * z
        tangent_2 = sine_2 / (w * w)
        if tangent_2 < 1e-3:  # the series of atan, exact to rounding here
            series = 1 / 3 - tangent_2 * (1 / 5 - tangent_2 * (1 / 7 - tangent_2 * (1 / 9 - tangent_2 / 11)))
            factor = 2.0 / w * (1.0 - tangent_2 * series)
        else:
            factor = 2.0 * math.atan2(math.sqrt(sine_2), w) / math.sqrt(sine_2)
        state[TURN, j] = factor * x
        state[TURN + 1, j] = factor * y
        state[TURN + 2, j] = factor * z


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sin_cos(angle: float) -> tuple[float, float]:
    """Return sine and cosine to 2e-16 for angles up to 1e5, without a branch or a call into a library."""
    quarters = np.floor(angle * (2.0 / math.pi) + 0.5)
    sine, cosine = _sin_cos_near_zero(angle - quarters * QUARTER_HIGH - quarters * QUARTER_LOW)
    quadrant = quarters - 4.0 * np.floor(quarters * 0.25)
    is_odd = (quadrant == 1.0) | (quadrant == 3.0)
    sine, cosine = (cosine, sine) if is_odd else (sine, cosine)
    sine = -sine if quadrant >= 2.0 else sine
    cosine = -cosine if (quadrant == 1.0) | (quadrant == 2.0) else cosine
    return sine, cosine


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sin_cos_near_zero(angle: float) -> tuple[float, float]:
    """Return sine and cosine by their series: to 2e-16 up to pi/4, to 1e-11 up to pi/2."""
    s = angle * angle
    sine = angle * (1.0 - s * (S3 - s * (S5 - s * (S7 - s * (S9 - s * (S11 - s * (S13 - s * S15)))))))
    cosine = 1.0 - s * (C2 - s * (C4 - s * (C6 - s * (C8 - s * (C10 - s * (C12 - s * (C14 - s * C16)))))))
    return sine, cosine

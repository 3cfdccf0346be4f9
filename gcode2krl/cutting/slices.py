"""Force of one tooth while it sweeps an arc, its mean and its peak over a revolution: functions of the core.

Their formulas stand in ``native/cutting/slices.h``.
"""

from gcode2krl.compiled.core import FLOAT, FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.cutting.cutter import SHAPE

arc_force = core_function("cutting_arc_force", *(FLOAT,) * 7, FLOATS, OUT_FLOATS)
"""Add to ``out[0:4]`` the integral over phi of the force on one tooth, per mm of edge contact width.

Takes the arc phi_a <= phi_b in rad, at most one turn (an empty or NaN arc adds nothing); sine and cosine of
the edge angle kappa; the feed per tooth along the velocity in mm; sine and cosine of the descent angle, -90°
to 90°; the law (8,) of `law.law_array`; and ``out`` (4,): feed, normal and axial force (holder to tip) and
tangential force, N·rad/mm. The contact width is db = dz/sin kappa; the mean over a revolution is
teeth/(2·pi)·db times this.
"""

mean_rows = core_function("cutting_mean_rows", *(FLOATS,) * 4, FLOAT, SHAPE, FLOATS, OUT_FLOATS)
"""Write the mean feed, normal and axial force in N and the torque in N·mm, ``out`` (n, 4), of n samples.

Takes ``phi_rad`` (n, 2k) arcs, NaN pairs are none; ``a_p_mm``, ``f_z_mm``, ``ramp_rad`` (n,); the number of
teeth; a `cutter.Shape`; the law (8,); ``out``.
"""

peak_rows = core_function("cutting_peak_rows", *(FLOATS,) * 4, INT, FLOAT, SHAPE, FLOATS, OUT_FLOATS)
"""Write the largest force in N, ``out`` (n,), on all teeth together over a revolution, helix included.

Takes what `mean_rows` takes, and after the teeth how much an edge lags behind the tip, rad per mm of height.
Sampled every 15° or closer, and where a whole tooth is in the cut or begins to leave it: there it jumps.
"""

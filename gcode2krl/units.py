"""Every conversion factor of the project; inside, lengths are mm, times s, angles rad, forces N."""

import math

MM_PER_INCH = 25.4
MM_PER_M = 1000.0
S_PER_MIN = 60.0
S_PER_H = 3600.0
MS_PER_S = 1000.0
US_PER_S = 1_000_000.0
UM_PER_MM = 1000.0
NMM_PER_NM = 1000.0
N_PER_KN = 1000.0
RAD_PER_MRAD = 1e-3
RAD_PER_DEG = math.pi / 180.0
DEG_PER_RAD = 180.0 / math.pi
RAD_PER_REV = 2.0 * math.pi
BYTES_PER_MB = 1_000_000
GRAVITY_M_S2 = 9.80665
"""Standard gravity (CGPM 1901): of weights."""

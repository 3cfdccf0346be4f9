; helical arcs, corners with Z in the block, Z alone in an inside corner
G21 G17 G90
T1 M6
F500 G0 X20 Y0 Z0
G41 D1 G1 X20 Y-15
G3 X20 Y15 J15 Z-3
G1 X-20 Z-4
Z-2
G1 Z-5
Y-15 Z-6
G1 X-30 Y-40 Z-1
G2 X-60 Y-40 I-15 Z-4 P2
G40 G1 Z5
G0 X0 Y0
M2

; a diameter of 0 moves nothing: arcs and G53 are as without
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G41.1 D0
G1 Z-1
G1 X10
G2 X20 I5
G53 G0 X5
G40
G2 X15 I5
M2

; the outside of a square, cutter left, from the outside in by a straight line
G21 G17 G90
T1 M6
G0 X-20 Y-10 Z5
G1 Z-2 F300
G41 D1 G1 X0 Y0
Y30
X30
Y0
X-10
G40 G1 X-20 Y-10
G0 Z5
M2

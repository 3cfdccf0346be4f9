; the inside of a square, cutter left, anticlockwise: every corner is an inside one
G21 G17 G90
T2 M6
G0 X15 Y15 Z5
G1 Z-2 F300
G41 D2
G1 X15 Y0
X30
Y30
X0
Y0
X15
G40 G0 Y15
M2

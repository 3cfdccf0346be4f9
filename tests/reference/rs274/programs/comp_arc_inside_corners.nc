; inside corners between a line and an arc, and between two arcs
G21 G17 G90
T2 M6
F400 G0 X-10 Y0 Z0
G42 D2 G1 X0 Y0
X20
G3 X20 Y-30 J-15
G1 X0
G2 X-20 Y-20 I-5 J15
G2 X-40 Y-20 I-10 J1
G1 X-60 Y10
G40 G0 X-80
M2

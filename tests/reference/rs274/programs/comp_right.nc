; cutter right, inside and outside corners, acute and obtuse
G21 G17 G90
T2 M6
F400 G0 X0 Y-10 Z0
G42
G1 X0 Y0
X10 Y20
X20 Y0
X40 Y5
X25 Y15
X40 Y30
X0 Y60
G40 X-20
M2

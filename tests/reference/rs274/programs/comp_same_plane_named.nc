; what may be named while compensation is on: the same plane, units, distances, centres, F, S, T
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G41 G1 X20
G17 Y20
G91 G21 X-30
G91.1 S500 T2 X-20
G90 F100 G1 X-50 Y0
G40 X-80
M2

; rapid moves under compensation: no arc around an outside corner
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G42 G0 X20
G0 Y20
X40
G1 Y0
G0 X60 Y-20
X60 Y-20
G1 X60 Y-50
G40 G0 X0
M2

; moves of no length, a block that names the same point, Z alone
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G41 G1 X20
G1
X20 Y0
Z-1
Z1
Z-1
Y20
G1 F200
X20
G1 X20 Y40
Z3
G40 Z5
M2

; the program ends while compensation is on: the last move goes to its end
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G41 G1 X20
Y20
G3 X0 Y40 I-20
M30

; ways out: with and without motion, Z alone, then an arc; a straight move of no length
G21 G17 G90
T1 M6
F500 G0 X0 Y0 Z0
G41 G1 X10
X20
G40 G1 X30 Y10
G41 G1 X50
G40
G0 Z10
G2 X60 I5
G42 G1 X80 Y10
G40
G41 G1 X100 Y10
X120
G40
G28 X0
G1 X5 Y5
M2

; several contours in one program, with a tool change between; G40 twice; G40 with nothing to end
G21 G17 G90 G40
T1 M6
F500 G0 X0 Y0 Z0
G41 D1 G1 X10
Y10
G40
G40 G1 X0
T2 M6
G42 G1 X0 Y-10
X-10
G40 G0 X0 Y0
G41 D2
G40
G2 X10 I5
G41 D0 G1 X10 Y20
X-10
M2

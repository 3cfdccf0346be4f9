; back along the same line, and along the tangent of an arc (h and m shapes)
G21 G17 G90
T2 M6
F500 G0 X0 Y0 Z0
G41 G1 X20
X10
Y10
G40 G0 X0 Y0
G42 D2 G1 X20 Y0
G3 X0 Y0 I-10
G1 Y20
G40 G0 X100 Y0
G41 D2 G1 X90 Y0
G2 X70 Y0 I-10
G2 X50 Y0 I-10
G1 X50 Y-30
G40 X0
M2

; arcs whose radii at start and end differ by rounding, in inside corners
G21 G17 G90
T2 M6
F500 G0 X0 Y0 Z0
G41 G1 X20 Y0
G3 X20.01 Y19.99 I-5 J9.99
G1 X0 Y30
G3 X-14.15 Y24.16 I0 J-20
G3 X-20.01 Y10.02 I14.14 J-14.14
G1 X-40
G40 G1 Y-20
M2

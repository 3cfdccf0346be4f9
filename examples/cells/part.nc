%
(A square of 40 mm, 1 mm deep: fits every cell of this folder)
G21 G90 G54 G17
T1 M6
G43 H1
S9000 M3
G0 X0 Y0
G0 Z10
G1 Z-1 F300
G1 X40 F1200
G1 Y40
G1 X0
G1 Y0
G0 Z30
M5
M30
%

(SIGN)
(T4  D=6 CR=0 - ZMIN=-2 - flat end mill)
G90 G94
G17
G21
(When using Fusion for Personal Use, the feedrate of rapid moves is reduced)

(2D Pocket1)
T4
S12000 M3
G54
G0 X12 Y10
Z15
Z5
G1 Z1 F333
G2 X8 Y10 Z0 I-2 J0
X12 Z-1 I2
X8 I-2
X12 I2
G1 X30 Y10 F900
Y25
G3 X25 Y30 I-5 J0
G1 X12
Y10
G0 Z15
M5
G53 G0 Z0
G53 G0 X0 Y0
M30

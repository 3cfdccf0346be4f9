; inverse time counts the programmed length, feed per revolution the speed
G21 G17 G90
T1 M6
S1000 M3
G0 X0 Y0 Z0
G93
G41 D1
G1 X20 F5
Y20 F4
G3 X0 Y40 I-20 F2
G1 X-20 Y40 F3
Y60 F3
G94
F100 G1 X-40
G95 F.2
X-60
G3 Y80 J10
G40 G1 X-80
M2

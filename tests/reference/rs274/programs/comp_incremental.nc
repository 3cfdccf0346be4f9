; incremental: from the programmed point, not from the tool; also after G40
G21 G17 G91
T2 M6
F500 G0 X5 Y5
G41 D2 G1 X10
X10
Y10
G3 X-10 Y10 I-10
G1 X-10
G90.1 G2 X10 Y10 I15 J25
G40
G1 X10 Z2
X-5
M2

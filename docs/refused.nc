(what a refusal looks like: four mistakes in one short program)
G21 G90 G17
T1 M6
G0 G43 H2 Z50
G0 X0 Y0
G1 Z-5 F600
S12000 M3
G1 X1200 F1500
M88
G28 G91 Z0
M30

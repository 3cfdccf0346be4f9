; spindle, coolant, dwell and message between the moves of an inside corner keep their order
G21 G17 G90
T1 M6
S1000 M3
F500 G0 X0 Y0 Z0
G41 D1
G1 X20
M8
G4 P0.5
(MSG, in the corner)
S1500
G1 Z-1
G4 P0.25
X20 Y20
M9
G2 X40 Y40 I20
G4 P1
M5
X80 Y40 I20 J-20
G40
G4 P2
G1 X100
M2

( Made using CamBam - http://www.cambam.co.uk )
( part 3/24/2026 10:11:12 AM )
( T4 : 6.0 )
G21 G90 G91.1 G64 G40
G0 Z3.0
( T4 : 6.0 )
T4 M6
( Profile1 )
G17
M3 S12000
G0 X10.0 Y-3.0
G0 Z1.0
G1 F300.0 Z-1.0
G1 F800.0 X40.0
G3 X43.0 Y0.0 I0.0 J3.0
G1 Y30.0
G0 Z3.0
M5
M30

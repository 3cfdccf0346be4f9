(Exported by FreeCAD)
(Post Processor: grbl_post)
(Output Time:2026-03-24 10:11:12.000000)
(Begin preamble)
G17 G90
G21
(Begin operation: Fixture)
(Path: Fixture)
G54
(Finish operation: Fixture)
(Begin operation: TC: 4mm Endmill)
(Path: TC: 4mm Endmill)
(TC: 4mm Endmill)
(Begin toolchange)
( M6 T2 )
M3 S16000
(Finish operation: TC: 4mm Endmill)
(Begin operation: Pocket)
(Path: Pocket)
G0 Z5.000
G0 X10.000 Y10.000
G0 Z3.000
G1 X10.000 Y10.000 Z-1.000 F120.000
G1 X40.000 Y10.000 Z-1.000 F500.000
G3 X45.000 Y15.000 Z-1.000 I0.000 J5.000 K0.000 F500.000
G1 X45.000 Y30.000 Z-1.000 F500.000
G0 Z5.000
(Finish operation: Pocket)
(Begin postamble)
M5
G17 G90
M2

G21 G90 G17 G94 F500
G0 X0 Y0 Z0
o1 if [1]
o1 endif
o1 if [1]
o1 endif
M2

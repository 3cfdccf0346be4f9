G21 G90 G17 G94 F500
G0 X0 Y0 Z0
o1 repeat [2]
o1 break
o1 endrepeat
M2

G21 G90 G17 G94 F500
G0 X0 Y0 Z0
o1 while [1] X5
o1 endwhile
M2

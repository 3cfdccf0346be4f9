G21 G90 G17 G94 F500
G0 X0 Y0 Z0
#1=0
o1 while [#1 LT 3]
#1=[#1+1]
G1 X#1 E5
o1 endwhile
M2

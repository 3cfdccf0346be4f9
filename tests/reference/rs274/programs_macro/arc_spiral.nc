G21 G90 G17 G0 X0 Y0 Z0
F300
#1=1
o1 repeat [12]
G2 X[#1] Y0 I[[#1-#<_x>]/2] J0
G3 X[-#1] Y0 R[#1+0.5]
#1=[#1+0.5]
o1 endrepeat
M2

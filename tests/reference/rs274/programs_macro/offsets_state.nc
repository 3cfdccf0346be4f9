G21 G90 G0 X0 Y0 Z5
G10 L2 P2 X10 Y20
G55
X[#<_x>+1] Y[#5421]
X[#<_abs_x>] Y[#<_abs_y>]
M2

G21
G0 X1

X2 (c)
G1 Y1 F60 ; end
M2

G21
G0 X1
M30
G0 X2
this is not read

G21
G0 X1
this is not code
G0 X9
M2

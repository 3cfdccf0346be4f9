G21
G0 X1
(a (b) c)
G0 X9
M2

G21
(msg, hello)
G0 X1 (MSG, there)
M2

(header)
G21 (mm)
G0 X1 (first) Y2 (second)
X2 ; Y9
; G0 X5
(G0 X6)
(a ; b) Y3
X3 ; (open
M2



G21

   
G0 X1


X2

M2


G21 G90 G0 Z5
o1 if [0]
G1 X[1/0] Y#<nothing> garbage $
o2 while [#<nothing>]
o2 endwhile
o1 else
X1
o1 endif
o3 repeat [0]
G99 G98 T-1
o3 endrepeat
o4 sub
X5
o4 endsub
X2
M2

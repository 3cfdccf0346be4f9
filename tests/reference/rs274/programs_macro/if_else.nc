G21 G90
#1=0
o1 while [#1 LT 6]
o2 if [#1 EQ 1]
G0 X1
o2 elseif [#1 EQ 2]
G0 X2
o3 if [#1 GT 5]
G0 X99
o3 else
G0 X20
o3 endif
o2 elseif [#1 EQ 3]
G0 X3
o2 else
G0 X[100+#1]
o2 endif
#1=[#1+1]
o1 endwhile
o4 if [0]
G0 X77
o4 endif
o5 if [-0.5]
G0 X78
o5 endif
M2

G21 G90 G0 Z5
#1=0
o1 while [#1 LT 4]
#2=0
o2 repeat [#1]
#2=[#2+1]
G0 X#1 Y#2
o2 endrepeat
#1=[#1+1]
o1 endwhile
o3 repeat [0]
G0 X88
o3 endrepeat
o4 repeat [-2]
X89
o4 endrepeat
o5 repeat [2.6]
G91 X1
G90
o5 endrepeat
o6 do
G91 X1
G90
o6 while [#<_x> LT 12]
o7 while [0]
X90
o7 endwhile
o8 do
X50
o8 while [0]
M2

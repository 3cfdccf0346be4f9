G21 G90 G0 Z5
#1=0
o4 do
#1=[#1+1]
o5 if [#1 EQ 2]
o4 continue
o5 endif
G0 Y#1
o4 while [#1 LT 9]
#1=0
o1 while [1]
#1=[#1+1]
o2 if [#1 EQ 3]
o1 continue
o2 endif
o3 if [#1 GT 6]
o1 break
o3 endif
G0 X#1
o1 endwhile
#1=0
o7 while [#1 LT 3]
#1=[#1+1]
#2=0
o8 while [1]
#2=[#2+1]
o9 if [#2 GT #1]
o8 break
o9 endif
G0 X#1 Y#2
o8 endwhile
o7 endwhile
M2

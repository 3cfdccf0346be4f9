G21 G90 G17
#<_n>=7 #<_r>=25.4
o<drill> sub
G0 X#1 Y#2
G1 Z-3.5 F120
G0 Z5
o<drill> endsub
G0 Z5
#<i>=0
o10 while [#<i> LT #<_n>]
#<a>=[360*#<i>/#<_n>]
o<drill> call [#<_r>*COS[#<a>]] [#<_r>*SIN[#<a>]]
#<i>=[#<i>+1]
o10 endwhile
M2

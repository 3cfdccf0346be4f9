G21 G90 G0 X0 Y0 Z5
o<hole> call [10] [20]
o<hole> call [11] [21]
G0 X[#<_value>]
o400 call [3]
M2

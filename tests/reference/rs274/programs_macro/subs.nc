G21 G90 G0 Z5
#1=70 #2=71
o<square> sub
#<side>=#1
G0 X0 Y0
X#<side>
Y#<side>
X0
Y0
o<square> endsub [#<side>*#<side>]
o100 sub
o101 if [#1 LE 1]
o100 return [1]
o101 endif
o100 call [#1-1]
o100 endsub [#1*#<_value>]
o200 sub (many arguments)
X#1 Y#2 Z#30
X#<_call_level>
o200 endsub
o<square> call [10]
X#<_value> Y#<_value_returned> Z#1
o100 call [6]
X#<_value>
o200 call [1][2][3][4][5][6][7][8][9][10][11][12][13][14][15][16][17][18][19][20][21][22][23][24][25][26][27][28][29][30]
X#<_value> Y#<_value_returned>
o200 call [5]
#3=200
o#3 call [8] [9]
o[#3] call [9] [8] (a comment)
X#1 Y#2
o300 call [4]
M2
o300 sub
X[#1*100]
o300 endsub

G21 G90
#<width>=4 #<_depth>=6
G0 X#<width> Y#<_depth> Z[#<width>*#<_depth>]
#<Big Name>=3
X#<bigname> Y#<BIGNAME> Z#<big name>
#<width>=[#<width>+1]
X#<width> Y[EXISTS[#<width>]] Z[EXISTS[#<nothing>]]
X[EXISTS[#5]] Y[EXISTS[#<_depth>]] Z[EXISTS[#<_nothing>]]
o<s> sub
X[EXISTS[#<width>]] Y#<_depth>
#<width>=100 #<_depth>=50
X#<width>
o<s> endsub
o<s> call
X#<width> Y#<_depth>
o<s> call
M2

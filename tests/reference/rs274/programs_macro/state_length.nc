G21 G90 G0 X1 Y2 Z30
T2 M6 G43
G0 X[#<_tool_offset>+1] Z50
X#5400 Y[#<_z>]
X[#<_abs_z>] Y[#5422]
G49
X[#<_tool_offset>] Y[#<_abs_z>] Z[#5422]
M2

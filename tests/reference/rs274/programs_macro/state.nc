G21 G90 G17 G94
G0 X1 Y2 Z3
G0 X[#<_x>+10] Y[#<_y>*2] Z[#5422+1]
X#5420 Y#5421 Z[#<_metric>*7+#<_imperial>]
X[#<_absolute>] Y[#<_incremental>] Z#<_plane>
X[#<_units_per_minute>+#<_inverse_time>*2] Y#<_coord_system> Z#5220
G55
X#<_coord_system> Y#5220
G59.3
X#<_coord_system> Y#5220
G54
F120 S300 M3 M8
X#<_feed> Y#<_rpm> Z[#<_spindle_on>+#<_spindle_cw>*2+#<_flood>*4+#<_mist>*8]
M4 M7
Z[#<_spindle_on>+#<_spindle_cw>*2+#<_flood>*4+#<_mist>*8]
M5 M9
Z[#<_spindle_on>+#<_spindle_cw>*2+#<_flood>*4+#<_mist>*8]
T2 M6
X#<_current_tool> Y#<_selected_tool> Z#5400
G18
X#<_plane> Y#<_motion_mode> Z#<_ccomp>
G19 G91
X[#<_plane>/10] Y#<_incremental> Z#<_ijk_absolute_mode>
G90 G17 G90.1
X[#<_ijk_absolute_mode>] Y#<_spindle_rpm_mode> Z#<_call_level>
G20
X#<_x> Y[#5421/2] Z#<_imperial>
M2

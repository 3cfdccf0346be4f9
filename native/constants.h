/* Made by native/constants.py from the Python modules; not to be edited. */

#ifndef CONSTANTS_H
#define CONSTANTS_H

#include <stddef.h>
#include <stdint.h>

#include "core.h"

/* gcode2krl.ascii_codes */
#define CH_END_OF_TAPE 26
#define CH_CASE_BIT 32
#define CH_FIRST_FOREIGN 128

/* gcode2krl.krl_words */
#define W_LIN "LIN"
#define W_PTP "PTP"
#define W_C_DIS "C_DIS"
#define W_CIRC "CIRC"
#define W_CIRC_TYPE "$CIRC_TYPE=#BASE"
#define W_SPLINE "SPLINE"
#define W_SPL "SPL"
#define W_ENDSPLINE "ENDSPLINE"
#define W_BRAKE "BRAKE"
#define W_WAIT "WAIT"
#define W_SEC "SEC"
#define W_FOR "FOR"
#define W_HALT "HALT"
#define W_CONTINUE "CONTINUE"
#define W_DEF "DEF"
#define W_END "END"
#define W_EXT "EXT"
#define W_DECL "DECL"
#define W_GLOBAL "GLOBAL"
#define W_TRIGGER "TRIGGER"
#define W_WHEN "WHEN"
#define W_DISTANCE "DISTANCE"
#define W_DELAY "DELAY"
#define W_DO "DO"
#define W_PRIO "PRIO"
#define W_PRIO_BY_CONTROLLER (-1)
#define W_INTERRUPT "INTERRUPT"
#define W_PULSE "PULSE"
#define W_EXIT "EXIT"
#define W_RSI_INTERRUPT 21
#define W_STOP_INTERRUPT 3
#define W_BAS "BAS"
#define W_INITMOV "#INITMOV"
#define W_EXT_BAS "EXT BAS (BAS_COMMAND :IN,REAL :IN )"
#define W_RSI_FAST "#IPO_FAST"
#define W_RSI_SLOW "#IPO"
#define W_RSI_SLOW_CYCLE_S 0.012
#define W_VEL_CP "$VEL.CP"
#define W_APO_CDIS "$APO.CDIS"
#define W_BASE "$BASE"
#define W_TOOL "$TOOL"
#define W_LOAD "$LOAD"
#define W_ACT_BASE "$ACT_BASE"
#define W_ACT_TOOL "$ACT_TOOL"
#define W_BASE_DATA "BASE_DATA"
#define W_TOOL_DATA "TOOL_DATA"
#define W_LOAD_DATA "LOAD_DATA"
#define W_ROBROOT "$ROBROOT"
#define W_ROBROOT_NOW "$ROBROOT_C"
#define W_MACHINE_DEF "MACHINE_DEF"
#define W_OUT "$OUT"
#define W_OWN_PREFIX "GK_"
#define W_PILOT_SUBPROGRAM "GK_PILOT"
#define W_LOST_SUBPROGRAM "GK_RSI_LOST"
#define W_RSI_PREFIX "GK_RSI_"
#define W_RSI_RESULT "GK_RSI_RET"
#define W_RSI_ID "GK_RSI_ID"
#define W_FOLD ";FOLD"
#define W_ENDFOLD ";ENDFOLD"
#define W_DWELL "dwell"
#define W_NO_GUARD "(--no-guard)"
#define W_SOURCE_SUFFIX ".src"
#define W_DATA_SUFFIX ".dat"
#define W_SIDECAR_SUFFIX ".pilot.csv"
#define W_ETHERNET_SUFFIX "_ETH.xml"
#define W_LONGEST_LINE 471
#define W_LONGEST_NAME 24
#define W_LONGEST_RSI_NAME 16
#define W_KIND_LIN 0
#define W_KIND_PTP 1
#define W_KIND_VEL_CP 2
#define W_KIND_APO_CDIS 3
#define W_KIND_WAIT_SEC 4
#define W_KIND_OTHER 5
#define W_KIND_PTP_AXES 6
#define W_KIND_TRIGGER 7
#define W_KIND_CIRC 8
#define W_KIND_SPL 9
#define W_KIND_FORGETS 10
#define W_MALFORMED (-1)
#define W_ASSIGNS 1
#define W_CALLS 2
#define W_STATEMENT_COLUMNS 8
#define W_EXTERNAL_COLUMNS 6
#define W_TRIGGER_DISTANCE 0
#define W_TRIGGER_DELAY 1
#define W_TRIGGER_WRITTEN 2
#define W_TRIGGER_NAME 6
#define W_TRIGGER_NUMBERS 4

/* gcode2krl.units */
#define U_MM_PER_INCH 25.4
#define U_MM_PER_M 1000.0
#define U_S_PER_MIN 60.0
#define U_S_PER_H 3600.0
#define U_MS_PER_S 1000.0
#define U_US_PER_S 1000000.0
#define U_UM_PER_MM 1000.0
#define U_NMM_PER_NM 1000.0
#define U_N_PER_KN 1000.0
#define U_RAD_PER_MRAD 0.001
#define U_RAD_PER_DEG 0.017453292519943295
#define U_DEG_PER_RAD 57.29577951308232
#define U_RAD_PER_REV 6.283185307179586
#define U_BYTES_PER_MB 1000000
#define U_GRAVITY_M_S2 9.80665

/* gcode2krl.gcode.vocabulary */
#define V_CASE_BIT 32
#define V_LINE_LIMIT 4096
#define V_MARK 33
#define V_PROGRAM_LINE 36
#define V_UNREAD_NUMBER 32
#define V_ALPHABET "ABCDEFGHIJKLMNOPQRSTUVWXYZ@^"
#define V_LETTERS 28
#define V_WORD_D 3
#define V_WORD_E 4
#define V_WORD_F 5
#define V_WORD_H 7
#define V_WORD_L 11
#define V_WORD_P 15
#define V_WORD_Q 16
#define V_WORD_R 17
#define V_WORD_S 18
#define V_WORD_T 19
#define V_WORD_I 8
#define V_WORD_J 9
#define V_WORD_K 10
#define V_WORD_X 23
#define V_WORD_Y 24
#define V_WORD_Z 25
#define V_WORD_RADIUS 26
#define V_WORD_ANGLE 27
#define V_WORD_A 0
#define V_OTHER_AXES {0, 1, 2, 20, 21, 22}
#define V_ROTARY_AXES 3
#define V_TENFOLD 10
#define V_LARGEST_G 999
#define V_LARGEST_M 9999
#define V_G0 0
#define V_G4 40
#define V_G10 100
#define V_G20 200
#define V_G28 280
#define V_G28_1 281
#define V_G30 300
#define V_G30_1 301
#define V_G40 400
#define V_G41 410
#define V_G41_1 411
#define V_G42 420
#define V_G42_1 421
#define V_G43 430
#define V_G49 490
#define V_G43_1 431
#define V_G43_2 432
#define V_G43_4 434
#define V_G43_5 435
#define V_G52 520
#define V_G53 530
#define V_G54 540
#define V_G59 590
#define V_G64 640
#define V_G70 700
#define V_G71 710
#define V_G80 800
#define V_G90 900
#define V_G90_1 901
#define V_G91_1 911
#define V_G92 920
#define V_G92_1 921
#define V_G92_2 922
#define V_G92_3 923
#define V_G98 980
#define V_G99 990
#define V_M0 0
#define V_M1 1
#define V_M2 2
#define V_M30 30
#define V_M60 60
#define V_M3 3
#define V_M4 4
#define V_M5 5
#define V_M6 6
#define V_M7 7
#define V_M9 9
#define V_M19 19
#define V_M48 48
#define V_M53 53
#define V_M61 61
#define V_M66 66
#define V_M62 62
#define V_M63 63
#define V_M64 64
#define V_M65 65
#define V_M67 67
#define V_M68 68
#define V_M70 70
#define V_M71 71
#define V_M72 72
#define V_M73 73
#define V_M97 97
#define V_M98 98
#define V_M99 99
#define V_L_TOOL 1
#define V_L_OFFSET 2
#define V_L_TOOL_FROM_POSITION 10
#define V_L_TOOL_FROM_FIXTURE 11
#define V_L_OFFSET_FROM_POSITION 20
#define V_MOTION_CANCELLED (-1)
#define V_MOTION_RAPID 0
#define V_MOTION_LINE 1
#define V_MOTION_ARC_CW 2
#define V_MOTION_ARC_CCW 3
#define V_FIRST_CYCLE 73
#define V_CYCLE_CHIP 73
#define V_CYCLE_TAP_LEFT 74
#define V_CYCLE_DRILL 81
#define V_CYCLE_DWELL 82
#define V_CYCLE_PECK 83
#define V_CYCLE_TAP 84
#define V_CYCLE_REAM 85
#define V_CYCLE_BORE_STOP 86
#define V_CYCLE_BORE 89
#define V_CYCLE_SWIVEL 800
#define V_CYCLE_BEHIND 1000
#define V_CYCLE_ARGUMENTS 26
#define V_PLANE_XY 17
#define V_PLANE_ZX 18
#define V_PLANE_YZ 19
#define V_INVERSE_TIME 93
#define V_PER_MINUTE 94
#define V_PER_REVOLUTION 95
#define V_TURN_MACHINE 0
#define V_TURN_TIP 1
#define V_TURN_VECTOR 2
#define V_NON_MODAL 0
#define V_MOTION 1
#define V_PLANE 2
#define V_DISTANCE 3
#define V_CENTRE 4
#define V_FEED_MODE 5
#define V_UNIT 6
#define V_RADIUS_COMPENSATION 7
#define V_LENGTH_OFFSET 8
#define V_RETRACT 9
#define V_WORK_OFFSET 10
#define V_PATH_CONTROL 11
#define V_SPINDLE_MODE 12
#define V_SHIFT_STATE 13
#define V_GROUPS 14
#define V_M_STOP 4
#define V_M_IO 5
#define V_M_TOOL_CHANGE 6
#define V_M_SPINDLE 7
#define V_M_COOLANT 8
#define V_M_OVERRIDE 9
#define V_M_CODES 4

/* gcode2krl.gcode.dialect_marks */
#define D_SKIP_LEVEL 1
#define D_HEAD_LINES 2
#define D_DOLLAR_LINES 4
#define D_STATEMENTS 8
#define D_POINTS 16
#define D_MACROS 32
#define D_PROGRAMS_NONE 0
#define D_PROGRAMS_LINUXCNC 1
#define D_PROGRAMS_FANUC 2
#define D_PROGRAMS_SINUMERIK 3
#define D_NEXT_ABSOLUTE 60
#define D_NEXT_INCREMENTAL 62
#define D_NEXT_POINTLESS 46
#define D_NEXT_SHORTEST 63
#define D_NEXT_FORWARD 59
#define D_NEXT_BACKWARD 35
#define D_NEXT_VECTOR 42
#define D_TIP_ON 44
#define D_TIP_OFF 45
#define D_OTHER_TIP 34
#define D_SKIPPED 38
#define D_LABEL 48
#define D_SHIFT_SET 61
#define D_SHIFT_ADD 43
#define D_CORNER_ROUND 49
#define D_CORNER_SIDE 50
#define D_CORNER_LENGTH 51
#define D_CYCLE 52
#define D_ARGUMENT 53
#define D_MODAL 54
#define D_TURN_SET 55
#define D_TURN_ADD 56
#define D_TURN_DEG 57
#define D_TURN_OFF 39
#define D_MIRROR_SET 1
#define D_MIRROR_ADD 2
#define D_MIRROR_OFF 3
#define D_ARC_VIA 4
#define D_ARC_TANGENT 5
#define D_NEXT_VIA 6
#define D_APPROACH_CONTOUR 7
#define D_APPROACH_NORMAL 8
#define D_PROGRAM_NUMBER 58
#define D_HARMLESS 0
#define D_REFUSED 1
#define D_RADIUS 2
#define D_TURNS 3
#define D_MESSAGE 4
#define D_CODE 5
#define D_ENDS 6
#define D_WHOLE_LINE 7
#define D_SHIFT 8
#define D_JUMP 9
#define D_TIP 10
#define D_FEED_AXES 11
#define D_MARKED 12
#define D_CYCLE_CALL 13
#define D_MODAL_CALL 14
#define D_TOOL_NAME 15
#define D_TURN 16
#define D_DEFINE 17
#define D_VARIABLE 18
#define D_NAMED_ARC 19
#define D_APPROACH 20
#define D_KIND_STEP 32
#define D_LEAD_AT_ENTRY 0
#define D_LEAD_TO_CONTOUR 1
#define D_LEAD_BY_CORNER 2
#define D_D_IS_TOOL 0
#define D_D_IS_RADIUS 1
#define D_D_IS_DIAMETER 2
#define D_D_IS_WEAR 3
#define D_AS_WRITTEN 0
#define D_POINT_REQUIRED 1
#define D_THOUSANDTHS 2
#define D_CALCULATOR 3
#define D_MOST_CODES 9999
#define D_CODE_UNKNOWN (-1)
#define D_CODE_HARMLESS (-2)
#define D_CODE_EXACT (-3)
#define D_CODE_CALL (-4)
#define D_CODE_NO_OFFSET (-5)
#define D_CODE_TURN (-6)
#define D_CODE_TURN_OFF (-7)
#define D_CODE_OFFSET (-8)
#define D_CODE_MIRROR (-9)
#define D_CODE_MIRROR_OFF (-10)
#define D_CODE_CORNER_ARC (-11)
#define D_CODE_CORNER_MEETING (-12)
#define D_CODE_REFUSED (-13)

/* gcode2krl.gcode.dialects */
#define DR_FIRST_REAL 100
#define DR_REASON_TILTED 0
#define DR_REASON_POLAR 3
#define DR_REASON_OFFSET 7
#define DR_REASON_SETTING 13
#define DR_REASON_JOG 12
#define DR_REASON_TOOL_NAME 17
#define DR_REASON_VALUES 10
#define DR_REASON_NO_TIP 34
#define DR_REASON_VECTOR_AND_ANGLE 35
#define DR_REASON_VECTOR_ARC 36
#define DR_REASON_OTHER_TIP 37
#define DR_REASON_SHIFT_AND_TIP 38
#define DR_REASON_ZERO_AND_TIP 39
#define DR_REASON_FEED_AXES 40
#define DR_REASON_PARENTHESES 41
#define DR_REASON_SEMICOLON 42
#define DR_REASON_CORNER 43
#define DR_REASON_STORED 44
#define DR_REASON_G10 45
#define DR_REASON_CYCLE_BESIDE 47
#define DR_REASON_HEIGHTS 48
#define DR_REASON_NO_OFFSET 49
#define DR_REASON_MODAL_ZERO 50
#define DR_REASON_TURN 51
#define DR_REASON_TURNED 52
#define DR_REASON_FIRST_TURNED 53
#define DR_REASON_PECKS 54
#define DR_REASON_PITCH 55
#define DR_REASON_MIRROR 56
#define DR_REASON_NAMED_ARC 57
#define DR_REASON_LOOK_AHEAD 58
#define DR_REASON_ENTRY_ARC 59
#define DR_REASON_LEAD_OUT 60
#define DR_REASON_D 61
#define DR_REASON_CORNERS_OF_G41 62
#define DR_REASON_TOOL_OFFSET 63
#define DR_REASON_FREE_CONTOUR 64
#define DR_REASON_TNC_INCHES 65
#define DR_REASON_TOOL_CALL 66
#define DR_REASON_TNC_LABEL 67
#define DR_REASON_TNC_POLE 68
#define DR_REASON_TNC_ARC 69
#define DR_REASON_TNC_WORD 70
#define DR_REASON_TNC_M 71
#define DR_REASON_HOLE 72
#define DR_REASON_REAM 73
#define DR_REASON_BORE 74
#define DR_REASON_ROTATED 1
#define DR_REASON_SCALED 2
#define DR_REASON_BORING 4
#define DR_REASON_PROBING 5
#define DR_REASON_CYCLE 8
#define DR_REASON_SMOOTH 15
#define DR_REASON_SHIFT 20
#define DR_FIRST_VARIABLE 100
#define DR_REASON_EDGE 22
#define DR_REASON_FLOW 9
#define DR_REASON_BESIDE 21
#define DR_REASON_VECTORS 11
#define DR_REASON_SHIFT_BESIDE 32
#define DR_REASON_MESSAGE 31
#define DR_REASON_PROGRAM 23
#define DR_REASON_STILL 27
#define DR_REASON_TWICE 28
#define DR_REASON_MOVED 29
#define DR_DEFAULT "linuxcnc"
#define DR_OTHER_POST "export the part again with a post for LinuxCNC, Fanuc or Sinumerik"

/* gcode2krl.gcode.findings */
#define F_OK 0
#define F_BAD_CHARACTER 1
#define F_NO_NUMBER 2
#define F_NUMBER_TOO_LONG 3
#define F_COMMENT_OPEN 4
#define F_COMMENT_NESTED 5
#define F_EXPRESSION 6
#define F_O_WORD 7
#define F_LINE_TOO_LONG 8
#define F_UNKNOWN_LETTER 9
#define F_ROTARY_WORD 10
#define F_REPEATED_WORD 11
#define F_SAME_GROUP_G 12
#define F_SAME_GROUP_M 13
#define F_UNKNOWN_G 14
#define F_UNSUPPORTED_G 15
#define F_UNSUPPORTED_M 16
#define F_BAD_M 17
#define F_NO_FEED 18
#define F_NEGATIVE_FEED 19
#define F_NO_INVERSE_TIME 20
#define F_FEED_PER_REV_STOPPED 21
#define F_NO_MOTION_MODE 22
#define F_TWO_AXIS_CODES 23
#define F_UNUSED_WORD 24
#define F_ARC_NO_CENTRE 25
#define F_ARC_BOTH_FORMATS 26
#define F_ARC_RADIUS_MISMATCH 27
#define F_ARC_RADIUS_TOO_SMALL 28
#define F_ARC_R_FULL_CIRCLE 29
#define F_ARC_ZERO_RADIUS 30
#define F_ARC_WRONG_OFFSET 31
#define F_ARC_TURNS 32
#define F_ARC_NEEDS_OFFSETS 33
#define F_DWELL_NO_P 34
#define F_DWELL_NEGATIVE 35
#define F_TOOL_NOT_SELECTED 36
#define F_BAD_INTEGER 37
#define F_G53_NEEDS_RAPID_OR_FEED 38
#define F_G53_INCREMENTAL 39
#define F_NEGATIVE_TOLERANCE 40
#define F_NEGATIVE_SPEED 41
#define F_TOO_FAR 42
#define F_TOOL_UNDECLARED 43
#define F_H_DIFFERS 44
#define F_OFFSET_UNKNOWN 45
#define F_N_NOT_FIRST 46
#define F_TOO_MANY_M 47
#define F_DWELL_WITH_ARC 48
#define F_BAD_LINE_NUMBER 49
#define F_UNKNOWN_START 50
#define F_ARC_TOO_LONG 51
#define F_DIALECT_CODE 52
#define F_DIALECT_STATEMENT 53
#define F_NO_POINT 54
#define F_COUNTED_FROM_UNKNOWN 55
#define F_EXPRESSION_VALUE 56
#define F_PARAMETER_UNDEFINED 57
#define F_PARAMETER_NUMBER 58
#define F_PARAMETER_READ_ONLY 59
#define F_SUBPROGRAM_MISSING 60
#define F_CALLS_TOO_DEEP 61
#define F_TOO_MANY_STEPS 62
#define F_LOOP_WITHOUT_CHANGE 63
#define F_TOO_MANY_ROWS 64
#define F_NO_MACHINE 65
#define F_ROTARY_UNKNOWN 66
#define F_VECTOR_NO_MACHINE 67
#define F_VECTOR_ZERO 68
#define F_VECTOR_AND_ANGLE 69
#define F_VECTOR_ARC 70
#define F_TURN_PER_REV 71
#define F_TURN_TOO_FAR 72
#define F_CYCLE_TURNED 73
#define F_CUTTER_ON 74
#define F_CUTTER_PLANE 75
#define F_CUTTER_NO_D 76
#define F_CUTTER_NO_TOOL 77
#define F_CUTTER_NO_DIAMETER 78
#define F_CUTTER_LATHE 79
#define F_CUTTER_DIFFERS 80
#define F_CUTTER_ENTRY 81
#define F_CUTTER_ENTRY_ARC 82
#define F_CUTTER_EXIT_ARC 83
#define F_CUTTER_ARC 84
#define F_CUTTER_CORNER 85
#define F_CUTTER_SHORT 86
#define F_CUTTER_ROTATED 87
#define F_CUTTER_TURNED 88
#define F_CUTTER_PARAMETER 89

/* gcode2krl.gcode.cycle_findings */
#define FC_NO_AXES 200
#define FC_INVERSE_TIME 201
#define FC_MODES_CHANGED 202
#define FC_NO_R 203
#define FC_NO_DEPTH 204
#define FC_DISTANCE_CHANGED 205
#define FC_R_BELOW_DEPTH 206
#define FC_REPEATS 207
#define FC_NO_DWELL 208
#define FC_DWELL_NEGATIVE 209
#define FC_NO_PECK 210
#define FC_PECK_NOT_POSITIVE 211
#define FC_CLEARANCE_NEGATIVE 212
#define FC_SPINDLE_OFF 213
#define FC_SPINDLE_DIRECTION 214
#define FC_TOO_LONG 215

/* gcode2krl.gcode.polar_findings */
#define FP_PLANE 240
#define FP_WITH_AXIS 241
#define FP_G53 242
#define FP_AT_ZERO 243

/* gcode2krl.gcode.offset_findings */
#define FO_NO_AXES 220
#define FO_WITHOUT_L 221
#define FO_UNKNOWN_L 222
#define FO_WRONG_SYSTEM 223
#define FO_WRONG_TOOL 224
#define FO_TOOL_UNDECLARED 225
#define FO_NO_LENGTH 226
#define FO_ROTATION_BY_POSITION 227
#define FO_TOOL_ACROSS 228
#define FO_ADDED_BY_WORDS 229
#define FO_ADDED_WITHOUT_H 230
#define FO_FROM_UNKNOWN 231
#define FO_AT_START 232
#define FO_LENGTH_DIFFERS 233
#define FO_ROTARY 234
#define FO_ROTATION_WITH_ROTARY 235

/* gcode2krl.gcode.mode_findings */
#define FM_IO_WORD 260
#define FM_IO_VALUE 261
#define FM_IO_BESIDE 262
#define FM_TOOL_NUMBER 263
#define FM_NOT_SAVED 264
#define FM_RESTORE_BESIDE 265
#define FM_RESTORE_CUTTER 266
#define FM_RESTORE_LENGTH 267

/* gcode2krl.gcode.state */
#define S_MM_PER_INCH 25.4
#define S_ZERO_DROPPED 1
#define S_ZERO_OFF 2
#define S_UNREAD_CORNERS 1
#define S_UNREAD_APPROACH 2
#define S_CUTTER_ON 1
#define S_CUTTER_BESIDE 2
#define S_DOUBT_X 1
#define S_DOUBT_Y 2
#define S_DOUBT_Z 4
#define S_DOUBT_MOTION 8
#define S_DOUBT_FEED 16
#define S_DOUBT_UNIT 32
#define S_DOUBT_PLANE 64
#define S_DOUBT_DISTANCE 128
#define S_DOUBT_CENTRE 256
#define S_DOUBT_FEED_MODE 512
#define S_DOUBT_TOOL 1024
#define S_DOUBT_SPEED 2048
#define S_DOUBT_POSITION 7
#define S_DOUBT_ALL 4095
#define S_NOTE_ROTARY 0
#define S_NOTE_CENTRE 1
#define S_NOTE_HOME 2
#define S_NOTE_OVERRIDE 3
#define S_NOTE_LOCAL 4
#define S_NOTE_SHIFT 5
#define S_NOTE_TABLE 6
#define S_NOTE_CODE 7
#define S_NOTE_STATEMENT 8
#define S_NOTE_SMALL_ARC 9
#define S_AT_START (-1)
#define S_UNKNOWN_GROUP (-1)
#define S_UNSUPPORTED_GROUP (-2)
#define S_FIRST_G505 9
#define S_FIRST_G54_1 104
#define S_FURTHER_OFFSETS 300
#define S_EVENT_TOOL 0
#define S_EVENT_SPINDLE 1
#define S_EVENT_COOLANT 2
#define S_EVENT_M 4
#define S_EVENT_TEXT 5
#define S_IMPLIED_M5 (-5)
#define S_OF_CYCLE 1000

/* gcode2krl.gcode.program_tables */
#define P_LINE_LIMIT 4096
#define P_MOST_PARAMETERS 5602
#define P_LOCAL_PARAMETERS 30
#define P_MOST_R 100
#define P_FIRST_REAL 100
#define P_FIRST_INT 2000
#define P_FIRST_BOOL 4000
#define P_MACRO_LOCALS 33
#define P_MACRO_COMMON {100, 199}
#define P_MACRO_KEPT {500, 999}
#define P_MACRO_END 1000
#define P_FRAMES 10
#define P_MOST_NAMES 10000
#define P_MOST_REPEATS 256
#define P_LONGEST_NAME 255
#define P_ROOM_OF_LINE 8194
#define P_KIND_BLOCK 0
#define P_KIND_NOTHING 1
#define P_KIND_O_WORD 2
#define P_KIND_SUB 3
#define P_KIND_ENDSUB 4
#define P_KIND_RETURN 5
#define P_KIND_CALL 6
#define P_KIND_IF 7
#define P_KIND_ELSEIF 8
#define P_KIND_ELSE 9
#define P_KIND_ENDIF 10
#define P_KIND_WHILE 11
#define P_KIND_JUMP 12
#define P_KIND_DO_WHILE 13
#define P_KIND_REPEAT 14
#define P_KIND_PROGRAM_NUMBER 15
#define P_KIND_END_OF_FILE 16
#define P_KIND_FAULT 17
#define P_KIND_GOTO 18
#define P_KIND_MACRO_IF 19
#define P_KIND_MACRO_WHILE 20
#define P_KIND_SIEMENS_IF 21
#define P_KIND_FOR 22
#define P_KIND_ENDFOR 23
#define P_KIND_UNTIL 24
#define P_KIND_SECTION 25

/* gcode2krl.gcode.program_faults */
#define PF_NO_VALUE 0
#define PF_UNCLOSED_BRACKET 1
#define PF_UNKNOWN_FUNCTION 2
#define PF_UNKNOWN_OPERATOR 3
#define PF_NO_BRACKET 4
#define PF_NO_SLASH 5
#define PF_NO_EQUALS 6
#define PF_NAME_UNCLOSED 7
#define PF_NAME_TOO_LONG 8
#define PF_TOO_MANY_NAMES 9
#define PF_TOO_DEEP 10
#define PF_NO_PARAMETER 11
#define PF_BEHIND_O_WORD 12
#define PF_MACRO_NAME 13
#define PF_MACRO_ALONE 14
#define PF_MACRO_BEHIND_IF 15
#define PF_MACRO_BEHIND_THEN 16
#define PF_MACRO_BEHIND_WHILE 17
#define PF_MACRO_COMPARISONS 18
#define PF_MACRO_NULL 19
#define PF_SIEMENS_VALUE 20
#define PF_SIEMENS_BRACKET 21
#define PF_SIEMENS_TWO 22
#define PF_SIEMENS_COMPARISONS 23
#define PF_SIEMENS_SAME_BLOCK 24
#define PF_SIEMENS_GOTO 25
#define PF_NAME_COMMENT 26
#define PF_SIEMENS_UNDEFINED 27
#define PF_SIEMENS_DEF 28
#define PF_SIEMENS_TRUTH 29
#define PF_SIEMENS_FOR 30
#define PF_SIEMENS_BEHIND 31
#define PF_DIVISION_BY_ZERO 0
#define PF_SQUARE_ROOT 1
#define PF_LOGARITHM 2
#define PF_ARC_COSINE 3
#define PF_ARC_SINE 4
#define PF_POWER 5
#define PF_NOT_A_NUMBER 6
#define PF_INFINITE 7
#define PF_IN_MACHINE_UNIT 8
#define PF_OF_TOOL_TABLE 9
#define PF_OF_OTHER_AXIS 10
#define PF_FEED_OF_TIME 11
#define PF_FEED_OF_OTHER_UNIT 12
#define PF_TURNED_UNDER_SHIFT 13
#define PF_MACRO_OF_CONTROL 14
#define PF_MACRO_UNKNOWN 15
#define PF_MACRO_ALARM 16
#define PF_MACRO_ATAN 17
#define PF_MACRO_ASIN 18
#define PF_MACRO_ROUND 19
#define PF_MACRO_NEAR 20
#define PF_MACRO_BITS 21
#define PF_MACRO_REMAINDER 22
#define PF_SIEMENS_R 23
#define PF_VALUE_REMEDY "check the parameters that the expression takes"
#define PF_FAULT_LABEL 0
#define PF_FAULT_WORD 1
#define PF_FAULT_NO_OPENING 2
#define PF_FAULT_NO_CLOSING 3
#define PF_FAULT_CROSSED 4
#define PF_FAULT_LABEL_TWICE 5
#define PF_FAULT_NESTED_SUB 6
#define PF_FAULT_NOT_IN_SUB 7
#define PF_FAULT_NOT_IN_LOOP 8
#define PF_FAULT_TWO_STYLES 9
#define PF_FAULT_FILE_ENDS 10
#define PF_FAULT_M99_IN_MAIN 11
#define PF_FAULT_M98_WORDS 12
#define PF_FAULT_SUB_TWICE 13
#define PF_FAULT_CALL_NUMBER 14
#define PF_FAULT_ARGUMENTS 15
#define PF_FAULT_REPEATS 16
#define PF_FAULT_NOT_FIRST 17
#define PF_FAULT_BEHIND 18
#define PF_FAULT_STATEMENT 19
#define PF_FAULT_DO_NUMBER 20
#define PF_FAULT_DO_OPEN 21
#define PF_FAULT_END_ALONE 22
#define PF_FAULT_NO_LABEL 23
#define PF_FAULT_INTO_LOOP 24
#define PF_FAULT_NEXT_PROGRAM 25
#define PF_FAULT_MACRO_WORDS 26
#define PF_FAULT_MACRO_POINT 27
#define PF_FAULT_M98_MACRO 28
#define PF_FAULT_M99_WORDS 29
#define PF_FAULT_LOCAL 30
#define PF_FAULT_STRUCTURE 31
#define PF_FAULT_SECTION 32
#define PF_FAULT_SECTION_LABEL 33
#define PF_FAULT_SECTION_TIMES 34
#define PF_FAULT_FOR_END 35

/* gcode2krl.gcode.parameter_names */
#define N_LINE 0
#define N_MOTION_MODE 1
#define N_PLANE 2
#define N_CCOMP 3
#define N_METRIC 4
#define N_IMPERIAL 5
#define N_ABSOLUTE 6
#define N_INCREMENTAL 7
#define N_INVERSE_TIME 8
#define N_UNITS_PER_MINUTE 9
#define N_UNITS_PER_REV 10
#define N_COORD_SYSTEM 11
#define N_TOOL_OFFSET 12
#define N_RETRACT_R_PLANE 13
#define N_RETRACT_OLD_Z 14
#define N_SPINDLE_RPM_MODE 15
#define N_SPINDLE_CSS_MODE 16
#define N_IJK_ABSOLUTE_MODE 17
#define N_LATHE_DIAMETER_MODE 18
#define N_LATHE_RADIUS_MODE 19
#define N_SPINDLE_ON 20
#define N_SPINDLE_CW 21
#define N_MIST 22
#define N_FLOOD 23
#define N_FEED 24
#define N_RPM 25
#define N_CURRENT_TOOL 26
#define N_SELECTED_TOOL 27
#define N_X 28
#define N_Y 29
#define N_Z 30
#define N_ABS_X 31
#define N_ABS_Y 32
#define N_ABS_Z 33
#define N_VALUE 34
#define N_VALUE_RETURNED 35
#define N_CALL_LEVEL 36
#define N_TASK 37
#define N_PREDEFINED 38

/* gcode2krl.cutting.sweep */
#define SW_LANES 16
#define SW_BLOCK 32
#define SW_FLAT 0
#define SW_BALL 1
#define SW_OTHER 2

/* gcode2krl.cutting.edge */
#define ED_BAND_COLUMNS 7
#define ED_CHUNK 32

/* gcode2krl.cutting.reading */
#define RD_ARCS 3
#define RD_NODE_NUMBERS 21
#define RD_PROGRESS 3

/* gcode2krl.cutting.law */
#define LAW_MM_PER_M 1000.0
#define LAW_RAD_PER_REV 6.283185307179586
#define LAW_LINEAR_EDGE 0
#define LAW_KIENZLE 1
#define LAW_THIN_CHIP_MM 0.005
#define LAW_THICK_CHIP_MM 0.2

/* gcode2krl.robot.standing */
#define STANDING_RAD_PER_DEG 0.017453292519943295
#define STANDING_RAD_PER_REV 6.283185307179586
#define STANDING_UNREACHED 64
#define STANDING_FAST 128
#define STANDING_WRIST 256
#define STANDING_ALL_BITS {1, 2, 4, 8, 16, 32, 64, 128, 256}
#define STANDING_WRIST_ZONE_RAD 0.08726646259971647

/* gcode2krl.compliance.chain */
#define CHAIN_FRAMES 10
#define CHAIN_AXIS_FRAME {0, 1, 3, 5, 6, 7}
#define CHAIN_AXIS_SIGN {-1.0, 1.0, 1.0, -1.0, 1.0, -1.0}
#define CHAIN_AXIS_ZERO {0.0, 0.0, -1.5707963267948966, 0.0, 0.0, 3.141592653589793}

/* gcode2krl.collision.scene */
#define SCENE_MOST_BODIES 96
#define SCENE_PLANE 0
#define SCENE_BOX 1
#define SCENE_MESH 2
#define SCENE_LEAF 4

/* gcode2krl.collision.along */
#define ADVANCE_EXACT_MM 0.05
#define ADVANCE_EXACT_SHARE 0.25
#define ADVANCE_SHORT_MM 0.01

/* gcode2krl.online.feed */
#define FEED_WINDOW_S 0.02
#define FEED_LEAST_MM 0.02

/* gcode2krl.online.limits */
#define LIMITS_RAD_PER_DEG 0.017453292519943295
#define LIMITS_NO_CORRECTION 1000000.0

/* gcode2krl.online.blending */
#define BLENDING_STEADY_SHARE 0.2
#define BLENDING_WEIGHT 0
#define BLENDING_BEYOND_S 1
#define BLENDING_DISTRUSTED 2
#define BLENDING_ANCHOR 3
#define BLENDING_LAST 6

/* gcode2krl.online.pilot_gate */
#define PILOT_NO_KNOT_YET (-1)
#define PILOT_SPEED_SHARE 0.05
#define PILOT_PROOF_S 0.5
#define PILOT_JITTER_S 0.012
#define PILOT_REST_MM 0.002
#define PILOT_REST_S 0.05
#define PILOT_STARTED 0
#define PILOT_NEXT 1
#define PILOT_PROVEN 2
#define PILOT_REASON 3
#define PILOT_SYNCED 4
#define PILOT_OFFSET 5
#define PILOT_REAL 6
#define PILOT_PLANNED 7
#define PILOT_STILL 8
#define PILOT_POSITION 9
#define PILOT_GATE_OPEN 0
#define PILOT_GATE_NO_PILOT 1
#define PILOT_GATE_NOT_STARTED 2
#define PILOT_GATE_CHECKSUM 3
#define PILOT_GATE_OVERRIDE 4
#define PILOT_GATE_MODE 5
#define PILOT_GATE_ORDER 6
#define PILOT_GATE_SPEED 7
#define PILOT_GATE_UNPROVEN 8
#define PILOT_GATE_STANDS 9

/* gcode2krl.krl.differences */
#define DIFF_MOST_PLACES 1000
#define DIFF_DEG_PER_RAD 57.29577951308232
#define DIFF_RAD_PER_DEG 0.017453292519943295
#define DIFF_S_PER_MIN 60.0
#define DIFF_POSITION_LIMIT_MM 0.002
#define DIFF_ROTATION_LIMIT_DEG 0.001
#define DIFF_SPEED_LIMIT_MM_S 0.0016666666666666668
#define DIFF_JOINT_LIMIT_DEG 0.001
#define DIFF_CDIS_LIMIT_MM 0.0006
#define DIFF_WAIT_LIMIT_S 0.0006
#define DIFF_EXTERNAL_LIMIT 0.0006
#define DIFF_REMEDY "translate again"
#define DIFF_OTHER_KIND 0
#define DIFF_POSITION 1
#define DIFF_NO_POSITION 2
#define DIFF_ROTATION 3
#define DIFF_NO_ROTATION 4
#define DIFF_SPEED 5
#define DIFF_NO_SPEED 6
#define DIFF_CDIS 7
#define DIFF_WAIT 8
#define DIFF_OTHER_BRANCH 9
#define DIFF_EXTERNAL 10

typedef struct {
    double x;
    double y;
    double z;
    int8_t known_x;
    int8_t known_y;
    int8_t known_z;
    double unit_mm;
    int8_t absolute;
    int8_t arc_absolute;
    int32_t plane;
    int32_t motion;
    int32_t motion_beside_cycles;
    int32_t feed_mode;
    double feed;
    double feed_of_other_unit;
    double rpm;
    int32_t direction;
    int32_t tool;
    int8_t tool_stated;
    int32_t selected_tool;
    int32_t selected_line;
    double length_offset;
    int32_t offset_tool;
    int8_t exact_stop;
    double tolerance;
    int32_t work_offset;
    double base_mm[3];
    double shift_mm[3];
    double shift_kept_mm[3];
    int8_t turned_under_shift;
    int32_t shift_line;
    double pivot_mm[2];
    double rotation_cos;
    double rotation_sin;
    int8_t rotated;
    double turned_deg;
    double turned_about_mm[2];
    int32_t mirrored;
    int32_t flipped;
    int8_t turned_anew;
    int8_t offsets_taken;
    double home_28[3];
    double home_30[3];
    double rotary_deg[3];
    int32_t rotary_unknown;
    double home_28_deg[3];
    double home_30_deg[3];
    double tool_vector[3];
    int8_t has_vector;
    int8_t traori;
    int8_t zero_in_doubt;
    int32_t length_code;
    double feed_word;
    int32_t arcs;
    double arc_end[2];
    int64_t arc_end_rows;
    int8_t mist;
    int8_t flood;
    int8_t ended;
    int32_t end_line;
    int32_t tape_marks;
    int8_t unit_named;
    int64_t blocks;
    int32_t level;
    double largest_mm;
    int32_t unknown_feed_line;
    int8_t unknown_reported;
    int32_t doubt;
    int32_t motion_line;
    int32_t distance_line;
    int32_t distance_unnamed_line;
    int32_t feed_mode_line;
    int32_t rotary_refused;
    int32_t note_count[10];
    int32_t note_line[10];
    int32_t note_word[10];
    double moved_mm[9];
    int32_t misfits;
    int32_t misfits_other_centre;
    int32_t misfits_reversed;
    int32_t misfits_exchanged;
    int32_t spirals;
    int32_t spiral_line;
    double spiral_start;
    double spiral_end;
    double spiral_unit_mm;
    int32_t cutter_mode;
    int32_t cutter_side;
    int32_t cutter_code;
    int32_t cutter_line;
    double cutter_radius_mm;
    double cutter_other_mm[2];
    int8_t cutter_entered;
    int8_t cutter_led;
    int32_t cutter_idle;
    int32_t cutter_d;
    int32_t cutter_unread;
    int8_t cutter_failed;
    double cutter_normal[2];
    int32_t held_turn;
    int32_t held_line;
    double held_from[2];
    double held_along[2];
    double held_centre[2];
    double held_w[2];
    double held_sweep;
    int64_t held_rows[2];
    int64_t cutter_rows_removed;
    int64_t held_events;
    int32_t corner;
    int32_t corner_line;
    double corner_mm;
    double corner_from_mm[3];
    double corner_mm_s;
    int64_t corner_rows;
    int64_t corner_events;
    int32_t retract;
    int32_t retract_line;
    int32_t unset_parameter;
    int32_t unset_line;
    int32_t retract_unnamed_line;
    int8_t in_cycles;
    double cycle_level_mm;
    int8_t cycle_level_known;
    double cycle_r;
    double cycle_depth;
    double cycle_q;
    double cycle_p;
    int32_t cycle_line;
    int32_t cycle_plane;
    double cycle_unit_mm;
    int8_t cycle_absolute;
    int32_t modal_call;
    int32_t modal_arguments;
    double modal_argument[26];
    double modal_unit_mm;
} State;
typedef char State_x_stands_at_0[offsetof(State, x) == 0 ? 1 : -1];
typedef char State_y_stands_at_8[offsetof(State, y) == 8 ? 1 : -1];
typedef char State_z_stands_at_16[offsetof(State, z) == 16 ? 1 : -1];
typedef char State_known_x_stands_at_24[offsetof(State, known_x) == 24 ? 1 : -1];
typedef char State_known_y_stands_at_25[offsetof(State, known_y) == 25 ? 1 : -1];
typedef char State_known_z_stands_at_26[offsetof(State, known_z) == 26 ? 1 : -1];
typedef char State_unit_mm_stands_at_32[offsetof(State, unit_mm) == 32 ? 1 : -1];
typedef char State_absolute_stands_at_40[offsetof(State, absolute) == 40 ? 1 : -1];
typedef char State_arc_absolute_stands_at_41[offsetof(State, arc_absolute) == 41 ? 1 : -1];
typedef char State_plane_stands_at_44[offsetof(State, plane) == 44 ? 1 : -1];
typedef char State_motion_stands_at_48[offsetof(State, motion) == 48 ? 1 : -1];
typedef char State_motion_beside_cycles_stands_at_52[offsetof(State, motion_beside_cycles) == 52 ? 1 : -1];
typedef char State_feed_mode_stands_at_56[offsetof(State, feed_mode) == 56 ? 1 : -1];
typedef char State_feed_stands_at_64[offsetof(State, feed) == 64 ? 1 : -1];
typedef char State_feed_of_other_unit_stands_at_72[offsetof(State, feed_of_other_unit) == 72 ? 1 : -1];
typedef char State_rpm_stands_at_80[offsetof(State, rpm) == 80 ? 1 : -1];
typedef char State_direction_stands_at_88[offsetof(State, direction) == 88 ? 1 : -1];
typedef char State_tool_stands_at_92[offsetof(State, tool) == 92 ? 1 : -1];
typedef char State_tool_stated_stands_at_96[offsetof(State, tool_stated) == 96 ? 1 : -1];
typedef char State_selected_tool_stands_at_100[offsetof(State, selected_tool) == 100 ? 1 : -1];
typedef char State_selected_line_stands_at_104[offsetof(State, selected_line) == 104 ? 1 : -1];
typedef char State_length_offset_stands_at_112[offsetof(State, length_offset) == 112 ? 1 : -1];
typedef char State_offset_tool_stands_at_120[offsetof(State, offset_tool) == 120 ? 1 : -1];
typedef char State_exact_stop_stands_at_124[offsetof(State, exact_stop) == 124 ? 1 : -1];
typedef char State_tolerance_stands_at_128[offsetof(State, tolerance) == 128 ? 1 : -1];
typedef char State_work_offset_stands_at_136[offsetof(State, work_offset) == 136 ? 1 : -1];
typedef char State_base_mm_stands_at_144[offsetof(State, base_mm) == 144 ? 1 : -1];
typedef char State_shift_mm_stands_at_168[offsetof(State, shift_mm) == 168 ? 1 : -1];
typedef char State_shift_kept_mm_stands_at_192[offsetof(State, shift_kept_mm) == 192 ? 1 : -1];
typedef char State_turned_under_shift_stands_at_216[offsetof(State, turned_under_shift) == 216 ? 1 : -1];
typedef char State_shift_line_stands_at_220[offsetof(State, shift_line) == 220 ? 1 : -1];
typedef char State_pivot_mm_stands_at_224[offsetof(State, pivot_mm) == 224 ? 1 : -1];
typedef char State_rotation_cos_stands_at_240[offsetof(State, rotation_cos) == 240 ? 1 : -1];
typedef char State_rotation_sin_stands_at_248[offsetof(State, rotation_sin) == 248 ? 1 : -1];
typedef char State_rotated_stands_at_256[offsetof(State, rotated) == 256 ? 1 : -1];
typedef char State_turned_deg_stands_at_264[offsetof(State, turned_deg) == 264 ? 1 : -1];
typedef char State_turned_about_mm_stands_at_272[offsetof(State, turned_about_mm) == 272 ? 1 : -1];
typedef char State_mirrored_stands_at_288[offsetof(State, mirrored) == 288 ? 1 : -1];
typedef char State_flipped_stands_at_292[offsetof(State, flipped) == 292 ? 1 : -1];
typedef char State_turned_anew_stands_at_296[offsetof(State, turned_anew) == 296 ? 1 : -1];
typedef char State_offsets_taken_stands_at_297[offsetof(State, offsets_taken) == 297 ? 1 : -1];
typedef char State_home_28_stands_at_304[offsetof(State, home_28) == 304 ? 1 : -1];
typedef char State_home_30_stands_at_328[offsetof(State, home_30) == 328 ? 1 : -1];
typedef char State_rotary_deg_stands_at_352[offsetof(State, rotary_deg) == 352 ? 1 : -1];
typedef char State_rotary_unknown_stands_at_376[offsetof(State, rotary_unknown) == 376 ? 1 : -1];
typedef char State_home_28_deg_stands_at_384[offsetof(State, home_28_deg) == 384 ? 1 : -1];
typedef char State_home_30_deg_stands_at_408[offsetof(State, home_30_deg) == 408 ? 1 : -1];
typedef char State_tool_vector_stands_at_432[offsetof(State, tool_vector) == 432 ? 1 : -1];
typedef char State_has_vector_stands_at_456[offsetof(State, has_vector) == 456 ? 1 : -1];
typedef char State_traori_stands_at_457[offsetof(State, traori) == 457 ? 1 : -1];
typedef char State_zero_in_doubt_stands_at_458[offsetof(State, zero_in_doubt) == 458 ? 1 : -1];
typedef char State_length_code_stands_at_460[offsetof(State, length_code) == 460 ? 1 : -1];
typedef char State_feed_word_stands_at_464[offsetof(State, feed_word) == 464 ? 1 : -1];
typedef char State_arcs_stands_at_472[offsetof(State, arcs) == 472 ? 1 : -1];
typedef char State_arc_end_stands_at_480[offsetof(State, arc_end) == 480 ? 1 : -1];
typedef char State_arc_end_rows_stands_at_496[offsetof(State, arc_end_rows) == 496 ? 1 : -1];
typedef char State_mist_stands_at_504[offsetof(State, mist) == 504 ? 1 : -1];
typedef char State_flood_stands_at_505[offsetof(State, flood) == 505 ? 1 : -1];
typedef char State_ended_stands_at_506[offsetof(State, ended) == 506 ? 1 : -1];
typedef char State_end_line_stands_at_508[offsetof(State, end_line) == 508 ? 1 : -1];
typedef char State_tape_marks_stands_at_512[offsetof(State, tape_marks) == 512 ? 1 : -1];
typedef char State_unit_named_stands_at_516[offsetof(State, unit_named) == 516 ? 1 : -1];
typedef char State_blocks_stands_at_520[offsetof(State, blocks) == 520 ? 1 : -1];
typedef char State_level_stands_at_528[offsetof(State, level) == 528 ? 1 : -1];
typedef char State_largest_mm_stands_at_536[offsetof(State, largest_mm) == 536 ? 1 : -1];
typedef char State_unknown_feed_line_stands_at_544[offsetof(State, unknown_feed_line) == 544 ? 1 : -1];
typedef char State_unknown_reported_stands_at_548[offsetof(State, unknown_reported) == 548 ? 1 : -1];
typedef char State_doubt_stands_at_552[offsetof(State, doubt) == 552 ? 1 : -1];
typedef char State_motion_line_stands_at_556[offsetof(State, motion_line) == 556 ? 1 : -1];
typedef char State_distance_line_stands_at_560[offsetof(State, distance_line) == 560 ? 1 : -1];
typedef char State_distance_unnamed_line_stands_at_564[offsetof(State, distance_unnamed_line) == 564 ? 1 : -1];
typedef char State_feed_mode_line_stands_at_568[offsetof(State, feed_mode_line) == 568 ? 1 : -1];
typedef char State_rotary_refused_stands_at_572[offsetof(State, rotary_refused) == 572 ? 1 : -1];
typedef char State_note_count_stands_at_576[offsetof(State, note_count) == 576 ? 1 : -1];
typedef char State_note_line_stands_at_616[offsetof(State, note_line) == 616 ? 1 : -1];
typedef char State_note_word_stands_at_656[offsetof(State, note_word) == 656 ? 1 : -1];
typedef char State_moved_mm_stands_at_696[offsetof(State, moved_mm) == 696 ? 1 : -1];
typedef char State_misfits_stands_at_768[offsetof(State, misfits) == 768 ? 1 : -1];
typedef char State_misfits_other_centre_stands_at_772[offsetof(State, misfits_other_centre) == 772 ? 1 : -1];
typedef char State_misfits_reversed_stands_at_776[offsetof(State, misfits_reversed) == 776 ? 1 : -1];
typedef char State_misfits_exchanged_stands_at_780[offsetof(State, misfits_exchanged) == 780 ? 1 : -1];
typedef char State_spirals_stands_at_784[offsetof(State, spirals) == 784 ? 1 : -1];
typedef char State_spiral_line_stands_at_788[offsetof(State, spiral_line) == 788 ? 1 : -1];
typedef char State_spiral_start_stands_at_792[offsetof(State, spiral_start) == 792 ? 1 : -1];
typedef char State_spiral_end_stands_at_800[offsetof(State, spiral_end) == 800 ? 1 : -1];
typedef char State_spiral_unit_mm_stands_at_808[offsetof(State, spiral_unit_mm) == 808 ? 1 : -1];
typedef char State_cutter_mode_stands_at_816[offsetof(State, cutter_mode) == 816 ? 1 : -1];
typedef char State_cutter_side_stands_at_820[offsetof(State, cutter_side) == 820 ? 1 : -1];
typedef char State_cutter_code_stands_at_824[offsetof(State, cutter_code) == 824 ? 1 : -1];
typedef char State_cutter_line_stands_at_828[offsetof(State, cutter_line) == 828 ? 1 : -1];
typedef char State_cutter_radius_mm_stands_at_832[offsetof(State, cutter_radius_mm) == 832 ? 1 : -1];
typedef char State_cutter_other_mm_stands_at_840[offsetof(State, cutter_other_mm) == 840 ? 1 : -1];
typedef char State_cutter_entered_stands_at_856[offsetof(State, cutter_entered) == 856 ? 1 : -1];
typedef char State_cutter_led_stands_at_857[offsetof(State, cutter_led) == 857 ? 1 : -1];
typedef char State_cutter_idle_stands_at_860[offsetof(State, cutter_idle) == 860 ? 1 : -1];
typedef char State_cutter_d_stands_at_864[offsetof(State, cutter_d) == 864 ? 1 : -1];
typedef char State_cutter_unread_stands_at_868[offsetof(State, cutter_unread) == 868 ? 1 : -1];
typedef char State_cutter_failed_stands_at_872[offsetof(State, cutter_failed) == 872 ? 1 : -1];
typedef char State_cutter_normal_stands_at_880[offsetof(State, cutter_normal) == 880 ? 1 : -1];
typedef char State_held_turn_stands_at_896[offsetof(State, held_turn) == 896 ? 1 : -1];
typedef char State_held_line_stands_at_900[offsetof(State, held_line) == 900 ? 1 : -1];
typedef char State_held_from_stands_at_904[offsetof(State, held_from) == 904 ? 1 : -1];
typedef char State_held_along_stands_at_920[offsetof(State, held_along) == 920 ? 1 : -1];
typedef char State_held_centre_stands_at_936[offsetof(State, held_centre) == 936 ? 1 : -1];
typedef char State_held_w_stands_at_952[offsetof(State, held_w) == 952 ? 1 : -1];
typedef char State_held_sweep_stands_at_968[offsetof(State, held_sweep) == 968 ? 1 : -1];
typedef char State_held_rows_stands_at_976[offsetof(State, held_rows) == 976 ? 1 : -1];
typedef char State_cutter_rows_removed_stands_at_992[offsetof(State, cutter_rows_removed) == 992 ? 1 : -1];
typedef char State_held_events_stands_at_1000[offsetof(State, held_events) == 1000 ? 1 : -1];
typedef char State_corner_stands_at_1008[offsetof(State, corner) == 1008 ? 1 : -1];
typedef char State_corner_line_stands_at_1012[offsetof(State, corner_line) == 1012 ? 1 : -1];
typedef char State_corner_mm_stands_at_1016[offsetof(State, corner_mm) == 1016 ? 1 : -1];
typedef char State_corner_from_mm_stands_at_1024[offsetof(State, corner_from_mm) == 1024 ? 1 : -1];
typedef char State_corner_mm_s_stands_at_1048[offsetof(State, corner_mm_s) == 1048 ? 1 : -1];
typedef char State_corner_rows_stands_at_1056[offsetof(State, corner_rows) == 1056 ? 1 : -1];
typedef char State_corner_events_stands_at_1064[offsetof(State, corner_events) == 1064 ? 1 : -1];
typedef char State_retract_stands_at_1072[offsetof(State, retract) == 1072 ? 1 : -1];
typedef char State_retract_line_stands_at_1076[offsetof(State, retract_line) == 1076 ? 1 : -1];
typedef char State_unset_parameter_stands_at_1080[offsetof(State, unset_parameter) == 1080 ? 1 : -1];
typedef char State_unset_line_stands_at_1084[offsetof(State, unset_line) == 1084 ? 1 : -1];
typedef char State_retract_unnamed_line_stands_at_1088[offsetof(State, retract_unnamed_line) == 1088 ? 1 : -1];
typedef char State_in_cycles_stands_at_1092[offsetof(State, in_cycles) == 1092 ? 1 : -1];
typedef char State_cycle_level_mm_stands_at_1096[offsetof(State, cycle_level_mm) == 1096 ? 1 : -1];
typedef char State_cycle_level_known_stands_at_1104[offsetof(State, cycle_level_known) == 1104 ? 1 : -1];
typedef char State_cycle_r_stands_at_1112[offsetof(State, cycle_r) == 1112 ? 1 : -1];
typedef char State_cycle_depth_stands_at_1120[offsetof(State, cycle_depth) == 1120 ? 1 : -1];
typedef char State_cycle_q_stands_at_1128[offsetof(State, cycle_q) == 1128 ? 1 : -1];
typedef char State_cycle_p_stands_at_1136[offsetof(State, cycle_p) == 1136 ? 1 : -1];
typedef char State_cycle_line_stands_at_1144[offsetof(State, cycle_line) == 1144 ? 1 : -1];
typedef char State_cycle_plane_stands_at_1148[offsetof(State, cycle_plane) == 1148 ? 1 : -1];
typedef char State_cycle_unit_mm_stands_at_1152[offsetof(State, cycle_unit_mm) == 1152 ? 1 : -1];
typedef char State_cycle_absolute_stands_at_1160[offsetof(State, cycle_absolute) == 1160 ? 1 : -1];
typedef char State_modal_call_stands_at_1164[offsetof(State, modal_call) == 1164 ? 1 : -1];
typedef char State_modal_arguments_stands_at_1168[offsetof(State, modal_arguments) == 1168 ? 1 : -1];
typedef char State_modal_argument_stands_at_1176[offsetof(State, modal_argument) == 1176 ? 1 : -1];
typedef char State_modal_unit_mm_stands_at_1384[offsetof(State, modal_unit_mm) == 1384 ? 1 : -1];
typedef char State_has_its_size[sizeof(State) == 1392 ? 1 : -1];
VIEW(StateView, State);

typedef struct {
    int32_t is_saved;
    int32_t restored_on_return;
    double unit_mm;
    int32_t absolute;
    int32_t arc_absolute;
    int32_t plane;
    int32_t feed_mode;
    double feed;
    double feed_of_other_unit;
    double feed_word;
    double rpm;
    int32_t direction;
    int32_t mist;
    int32_t flood;
    double length_offset;
    int32_t offset_tool;
    int32_t length_code;
    int32_t exact_stop;
    double tolerance;
    int32_t work_offset;
    int32_t retract;
    int32_t cutter_mode;
} Modes;
typedef char Modes_is_saved_stands_at_0[offsetof(Modes, is_saved) == 0 ? 1 : -1];
typedef char Modes_restored_on_return_stands_at_4[offsetof(Modes, restored_on_return) == 4 ? 1 : -1];
typedef char Modes_unit_mm_stands_at_8[offsetof(Modes, unit_mm) == 8 ? 1 : -1];
typedef char Modes_absolute_stands_at_16[offsetof(Modes, absolute) == 16 ? 1 : -1];
typedef char Modes_arc_absolute_stands_at_20[offsetof(Modes, arc_absolute) == 20 ? 1 : -1];
typedef char Modes_plane_stands_at_24[offsetof(Modes, plane) == 24 ? 1 : -1];
typedef char Modes_feed_mode_stands_at_28[offsetof(Modes, feed_mode) == 28 ? 1 : -1];
typedef char Modes_feed_stands_at_32[offsetof(Modes, feed) == 32 ? 1 : -1];
typedef char Modes_feed_of_other_unit_stands_at_40[offsetof(Modes, feed_of_other_unit) == 40 ? 1 : -1];
typedef char Modes_feed_word_stands_at_48[offsetof(Modes, feed_word) == 48 ? 1 : -1];
typedef char Modes_rpm_stands_at_56[offsetof(Modes, rpm) == 56 ? 1 : -1];
typedef char Modes_direction_stands_at_64[offsetof(Modes, direction) == 64 ? 1 : -1];
typedef char Modes_mist_stands_at_68[offsetof(Modes, mist) == 68 ? 1 : -1];
typedef char Modes_flood_stands_at_72[offsetof(Modes, flood) == 72 ? 1 : -1];
typedef char Modes_length_offset_stands_at_80[offsetof(Modes, length_offset) == 80 ? 1 : -1];
typedef char Modes_offset_tool_stands_at_88[offsetof(Modes, offset_tool) == 88 ? 1 : -1];
typedef char Modes_length_code_stands_at_92[offsetof(Modes, length_code) == 92 ? 1 : -1];
typedef char Modes_exact_stop_stands_at_96[offsetof(Modes, exact_stop) == 96 ? 1 : -1];
typedef char Modes_tolerance_stands_at_104[offsetof(Modes, tolerance) == 104 ? 1 : -1];
typedef char Modes_work_offset_stands_at_112[offsetof(Modes, work_offset) == 112 ? 1 : -1];
typedef char Modes_retract_stands_at_116[offsetof(Modes, retract) == 116 ? 1 : -1];
typedef char Modes_cutter_mode_stands_at_120[offsetof(Modes, cutter_mode) == 120 ? 1 : -1];
typedef char Modes_has_its_size[sizeof(Modes) == 128 ? 1 : -1];
VIEW(ModesView, Modes);

typedef struct {
    int64_t rows;
    int64_t events;
    int64_t findings;
    int64_t marks;
    int64_t dropped;
    int64_t consequences;
    int64_t mute;
    int64_t rows_wanted;
    int64_t events_wanted;
    int64_t errors;
    int64_t program_wanted;
} Counts;
typedef char Counts_rows_stands_at_0[offsetof(Counts, rows) == 0 ? 1 : -1];
typedef char Counts_events_stands_at_8[offsetof(Counts, events) == 8 ? 1 : -1];
typedef char Counts_findings_stands_at_16[offsetof(Counts, findings) == 16 ? 1 : -1];
typedef char Counts_marks_stands_at_24[offsetof(Counts, marks) == 24 ? 1 : -1];
typedef char Counts_dropped_stands_at_32[offsetof(Counts, dropped) == 32 ? 1 : -1];
typedef char Counts_consequences_stands_at_40[offsetof(Counts, consequences) == 40 ? 1 : -1];
typedef char Counts_mute_stands_at_48[offsetof(Counts, mute) == 48 ? 1 : -1];
typedef char Counts_rows_wanted_stands_at_56[offsetof(Counts, rows_wanted) == 56 ? 1 : -1];
typedef char Counts_events_wanted_stands_at_64[offsetof(Counts, events_wanted) == 64 ? 1 : -1];
typedef char Counts_errors_stands_at_72[offsetof(Counts, errors) == 72 ? 1 : -1];
typedef char Counts_program_wanted_stands_at_80[offsetof(Counts, program_wanted) == 80 ? 1 : -1];
typedef char Counts_has_its_size[sizeof(Counts) == 88 ? 1 : -1];
VIEW(CountsView, Counts);

typedef struct {
    int64_t row;
    int32_t kind;
    int32_t line;
    double a;
    double b;
    double dwell;
    double q;
    double e;
} Event;
typedef char Event_row_stands_at_0[offsetof(Event, row) == 0 ? 1 : -1];
typedef char Event_kind_stands_at_8[offsetof(Event, kind) == 8 ? 1 : -1];
typedef char Event_line_stands_at_12[offsetof(Event, line) == 12 ? 1 : -1];
typedef char Event_a_stands_at_16[offsetof(Event, a) == 16 ? 1 : -1];
typedef char Event_b_stands_at_24[offsetof(Event, b) == 24 ? 1 : -1];
typedef char Event_dwell_stands_at_32[offsetof(Event, dwell) == 32 ? 1 : -1];
typedef char Event_q_stands_at_40[offsetof(Event, q) == 40 ? 1 : -1];
typedef char Event_e_stands_at_48[offsetof(Event, e) == 48 ? 1 : -1];
typedef char Event_has_its_size[sizeof(Event) == 56 ? 1 : -1];
VIEW(EventView, Event);

typedef struct {
    int32_t number;
    int32_t line;
    double a;
    double b;
    double c;
} Found;
typedef char Found_number_stands_at_0[offsetof(Found, number) == 0 ? 1 : -1];
typedef char Found_line_stands_at_4[offsetof(Found, line) == 4 ? 1 : -1];
typedef char Found_a_stands_at_8[offsetof(Found, a) == 8 ? 1 : -1];
typedef char Found_b_stands_at_16[offsetof(Found, b) == 16 ? 1 : -1];
typedef char Found_c_stands_at_24[offsetof(Found, c) == 24 ? 1 : -1];
typedef char Found_has_its_size[sizeof(Found) == 32 ? 1 : -1];
VIEW(FoundView, Found);

typedef struct {
    int64_t start;
    int64_t target;
    int64_t end;
    int64_t expression;
    int32_t kind;
    int32_t subprogram;
    int32_t first_message;
    int32_t fault;
    int32_t segment;
} MarkedLine;
typedef char MarkedLine_start_stands_at_0[offsetof(MarkedLine, start) == 0 ? 1 : -1];
typedef char MarkedLine_target_stands_at_8[offsetof(MarkedLine, target) == 8 ? 1 : -1];
typedef char MarkedLine_end_stands_at_16[offsetof(MarkedLine, end) == 16 ? 1 : -1];
typedef char MarkedLine_expression_stands_at_24[offsetof(MarkedLine, expression) == 24 ? 1 : -1];
typedef char MarkedLine_kind_stands_at_32[offsetof(MarkedLine, kind) == 32 ? 1 : -1];
typedef char MarkedLine_subprogram_stands_at_36[offsetof(MarkedLine, subprogram) == 36 ? 1 : -1];
typedef char MarkedLine_first_message_stands_at_40[offsetof(MarkedLine, first_message) == 40 ? 1 : -1];
typedef char MarkedLine_fault_stands_at_44[offsetof(MarkedLine, fault) == 44 ? 1 : -1];
typedef char MarkedLine_segment_stands_at_48[offsetof(MarkedLine, segment) == 48 ? 1 : -1];
typedef char MarkedLine_has_its_size[sizeof(MarkedLine) == 56 ? 1 : -1];
VIEW(MarkedLineView, MarkedLine);

typedef struct {
    int64_t number;
    int64_t entry;
    int32_t is_ready;
    int32_t is_program;
    int64_t given;
    int32_t given_line;
    int32_t missing;
    int32_t missing_line;
    int32_t missing_read;
    int64_t missing_given;
} Subprogram;
typedef char Subprogram_number_stands_at_0[offsetof(Subprogram, number) == 0 ? 1 : -1];
typedef char Subprogram_entry_stands_at_8[offsetof(Subprogram, entry) == 8 ? 1 : -1];
typedef char Subprogram_is_ready_stands_at_16[offsetof(Subprogram, is_ready) == 16 ? 1 : -1];
typedef char Subprogram_is_program_stands_at_20[offsetof(Subprogram, is_program) == 20 ? 1 : -1];
typedef char Subprogram_given_stands_at_24[offsetof(Subprogram, given) == 24 ? 1 : -1];
typedef char Subprogram_given_line_stands_at_32[offsetof(Subprogram, given_line) == 32 ? 1 : -1];
typedef char Subprogram_missing_stands_at_36[offsetof(Subprogram, missing) == 36 ? 1 : -1];
typedef char Subprogram_missing_line_stands_at_40[offsetof(Subprogram, missing_line) == 40 ? 1 : -1];
typedef char Subprogram_missing_read_stands_at_44[offsetof(Subprogram, missing_read) == 44 ? 1 : -1];
typedef char Subprogram_missing_given_stands_at_48[offsetof(Subprogram, missing_given) == 48 ? 1 : -1];
typedef char Subprogram_has_its_size[sizeof(Subprogram) == 56 ? 1 : -1];
VIEW(SubprogramView, Subprogram);

typedef struct {
    int64_t hash;
    int32_t start;
    int32_t length;
    double value;
    int64_t is_set;
} ParameterName;
typedef char ParameterName_hash_stands_at_0[offsetof(ParameterName, hash) == 0 ? 1 : -1];
typedef char ParameterName_start_stands_at_8[offsetof(ParameterName, start) == 8 ? 1 : -1];
typedef char ParameterName_length_stands_at_12[offsetof(ParameterName, length) == 12 ? 1 : -1];
typedef char ParameterName_value_stands_at_16[offsetof(ParameterName, value) == 16 ? 1 : -1];
typedef char ParameterName_is_set_stands_at_24[offsetof(ParameterName, is_set) == 24 ? 1 : -1];
typedef char ParameterName_has_its_size[sizeof(ParameterName) == 32 ? 1 : -1];
VIEW(ParameterNameView, ParameterName);

typedef struct {
    int64_t return_to;
    int64_t times;
    int64_t generation;
    int64_t entry;
    int64_t until;
    int32_t is_program;
    int32_t has_arguments;
    int32_t main_line;
    int32_t repeats;
    int64_t given;
    int64_t assigned;
    int32_t subprogram;
    int32_t call_line;
    double parameters[33];
} Frame;
typedef char Frame_return_to_stands_at_0[offsetof(Frame, return_to) == 0 ? 1 : -1];
typedef char Frame_times_stands_at_8[offsetof(Frame, times) == 8 ? 1 : -1];
typedef char Frame_generation_stands_at_16[offsetof(Frame, generation) == 16 ? 1 : -1];
typedef char Frame_entry_stands_at_24[offsetof(Frame, entry) == 24 ? 1 : -1];
typedef char Frame_until_stands_at_32[offsetof(Frame, until) == 32 ? 1 : -1];
typedef char Frame_is_program_stands_at_40[offsetof(Frame, is_program) == 40 ? 1 : -1];
typedef char Frame_has_arguments_stands_at_44[offsetof(Frame, has_arguments) == 44 ? 1 : -1];
typedef char Frame_main_line_stands_at_48[offsetof(Frame, main_line) == 48 ? 1 : -1];
typedef char Frame_repeats_stands_at_52[offsetof(Frame, repeats) == 52 ? 1 : -1];
typedef char Frame_given_stands_at_56[offsetof(Frame, given) == 56 ? 1 : -1];
typedef char Frame_assigned_stands_at_64[offsetof(Frame, assigned) == 64 ? 1 : -1];
typedef char Frame_subprogram_stands_at_72[offsetof(Frame, subprogram) == 72 ? 1 : -1];
typedef char Frame_call_line_stands_at_76[offsetof(Frame, call_line) == 76 ? 1 : -1];
typedef char Frame_parameters_stands_at_80[offsetof(Frame, parameters) == 80 ? 1 : -1];
typedef char Frame_has_its_size[sizeof(Frame) == 344 ? 1 : -1];
VIEW(FrameView, Frame);

typedef struct {
    int64_t word;
    int64_t end;
    int64_t left;
} Repeat;
typedef char Repeat_word_stands_at_0[offsetof(Repeat, word) == 0 ? 1 : -1];
typedef char Repeat_end_stands_at_8[offsetof(Repeat, end) == 8 ? 1 : -1];
typedef char Repeat_left_stands_at_16[offsetof(Repeat, left) == 16 ? 1 : -1];
typedef char Repeat_has_its_size[sizeof(Repeat) == 24 ? 1 : -1];
VIEW(RepeatView, Repeat);

typedef struct {
    int64_t name;
    int64_t number;
    double value;
} Assignment;
typedef char Assignment_name_stands_at_0[offsetof(Assignment, name) == 0 ? 1 : -1];
typedef char Assignment_number_stands_at_8[offsetof(Assignment, number) == 8 ? 1 : -1];
typedef char Assignment_value_stands_at_16[offsetof(Assignment, value) == 16 ? 1 : -1];
typedef char Assignment_has_its_size[sizeof(Assignment) == 24 ? 1 : -1];
VIEW(AssignmentView, Assignment);

typedef struct {
    int64_t segment;
    int64_t number;
    int64_t word;
    int64_t loop_first;
    int64_t loop_last;
} Label;
typedef char Label_segment_stands_at_0[offsetof(Label, segment) == 0 ? 1 : -1];
typedef char Label_number_stands_at_8[offsetof(Label, number) == 8 ? 1 : -1];
typedef char Label_word_stands_at_16[offsetof(Label, word) == 16 ? 1 : -1];
typedef char Label_loop_first_stands_at_24[offsetof(Label, loop_first) == 24 ? 1 : -1];
typedef char Label_loop_last_stands_at_32[offsetof(Label, loop_last) == 32 ? 1 : -1];
typedef char Label_has_its_size[sizeof(Label) == 40 ? 1 : -1];
VIEW(LabelView, Label);

typedef struct {
    int64_t steps;
    int64_t most_steps;
    int64_t most_rows;
    int64_t frame;
    int64_t generation;
    int64_t repeats;
    int64_t names;
    int64_t pool;
    int64_t assignments;
    int64_t words;
    int64_t marks;
    int64_t is_testing;
    int64_t wanted;
    int64_t wanted_number;
    int64_t wanted_word;
    int64_t main_words;
    int64_t is_stopped;
    double return_value;
    int64_t value_returned;
    int64_t subprograms;
    int64_t changes;
    int64_t laps;
    int64_t laps_until;
    int64_t lap_word;
    int64_t lap_frame;
    int64_t lap_changes;
} Course;
typedef char Course_steps_stands_at_0[offsetof(Course, steps) == 0 ? 1 : -1];
typedef char Course_most_steps_stands_at_8[offsetof(Course, most_steps) == 8 ? 1 : -1];
typedef char Course_most_rows_stands_at_16[offsetof(Course, most_rows) == 16 ? 1 : -1];
typedef char Course_frame_stands_at_24[offsetof(Course, frame) == 24 ? 1 : -1];
typedef char Course_generation_stands_at_32[offsetof(Course, generation) == 32 ? 1 : -1];
typedef char Course_repeats_stands_at_40[offsetof(Course, repeats) == 40 ? 1 : -1];
typedef char Course_names_stands_at_48[offsetof(Course, names) == 48 ? 1 : -1];
typedef char Course_pool_stands_at_56[offsetof(Course, pool) == 56 ? 1 : -1];
typedef char Course_assignments_stands_at_64[offsetof(Course, assignments) == 64 ? 1 : -1];
typedef char Course_words_stands_at_72[offsetof(Course, words) == 72 ? 1 : -1];
typedef char Course_marks_stands_at_80[offsetof(Course, marks) == 80 ? 1 : -1];
typedef char Course_is_testing_stands_at_88[offsetof(Course, is_testing) == 88 ? 1 : -1];
typedef char Course_wanted_stands_at_96[offsetof(Course, wanted) == 96 ? 1 : -1];
typedef char Course_wanted_number_stands_at_104[offsetof(Course, wanted_number) == 104 ? 1 : -1];
typedef char Course_wanted_word_stands_at_112[offsetof(Course, wanted_word) == 112 ? 1 : -1];
typedef char Course_main_words_stands_at_120[offsetof(Course, main_words) == 120 ? 1 : -1];
typedef char Course_is_stopped_stands_at_128[offsetof(Course, is_stopped) == 128 ? 1 : -1];
typedef char Course_return_value_stands_at_136[offsetof(Course, return_value) == 136 ? 1 : -1];
typedef char Course_value_returned_stands_at_144[offsetof(Course, value_returned) == 144 ? 1 : -1];
typedef char Course_subprograms_stands_at_152[offsetof(Course, subprograms) == 152 ? 1 : -1];
typedef char Course_changes_stands_at_160[offsetof(Course, changes) == 160 ? 1 : -1];
typedef char Course_laps_stands_at_168[offsetof(Course, laps) == 168 ? 1 : -1];
typedef char Course_laps_until_stands_at_176[offsetof(Course, laps_until) == 176 ? 1 : -1];
typedef char Course_lap_word_stands_at_184[offsetof(Course, lap_word) == 184 ? 1 : -1];
typedef char Course_lap_frame_stands_at_192[offsetof(Course, lap_frame) == 192 ? 1 : -1];
typedef char Course_lap_changes_stands_at_200[offsetof(Course, lap_changes) == 200 ? 1 : -1];
typedef char Course_has_its_size[sizeof(Course) == 208 ? 1 : -1];
VIEW(CourseView, Course);

typedef struct {
    Bytes text;
    Bytes statement_names;
    Ints32 statement_kinds;
    int64_t syntax;
    Bytes letter;
    Floats value;
    Ints32 line;
    Floats extra;
    Ints message_span;
    MarkedLineView lines;
    int64_t whole_program;
    int64_t first_line;
    int64_t words;
    int64_t marks;
    int64_t messages;
    int64_t program_lines;
    int64_t most_decimals;
} Scan;

typedef struct {
    Floats position_mm;
    Bools rapid;
    Floats feed_mm_s;
    Floats spindle_rad_s;
    Ints32 tool;
    Bools exact_stop;
    Floats tolerance_mm;
    Floats dwell_s;
    Ints32 source_line;
    Ints32 arc;
    Bools machine;
    Bools known;
    Floats length_offset_mm;
    Ints32 length_offset_tool;
    Floats turn;
    Ints32 turn_mode;
    Floats time_s;
} Rows;

typedef struct {
    StateView state;
    CountsView counts;
    Rows rows;
    EventView events;
    FoundView found;
    ModesView saved;
    Floats offsets;
    Bools offset_known;
    Floats tool_length_mm;
    Floats tool_diameter_mm;
    Floats cutter_diameter_mm;
    int64_t lead;
    int64_t square_corners;
    int64_t d_holds;
    int64_t programs;
    int64_t has_m61_to_m73;
    int64_t mounted_tool;
    Ints32 core_g;
    Floats dwell_by_letter;
    int64_t points;
    int64_t length_by_d;
    double cycle_dwell_s;
    int64_t repeats_by_k;
    int64_t g80_keeps_motion;
    int64_t idle_letters;
    int64_t end_m;
    int64_t whole_dwell_letter;
    Ints32 group_of_g;
    Ints32 doubt_of_g;
    Ints32 doubt_of_group;
    Ints32 doubt_of_letter;
    double chord_tolerance_mm;
    int64_t block_delete;
    int64_t lengths_from_table;
    int64_t rotary_axes;
    int64_t tcpm;
} Machine;

typedef struct {
    Bytes text;
    MarkedLineView lines;
    SubprogramView subprograms;
    ParameterNameView names;
    Ints32 name_slots;
    Bytes pool;
    Floats local_value;
    Ints local_generation;
    Floats parameters;
    FrameView frames;
    RepeatView repeats;
    AssignmentView assignments;
    CourseView course;
    StateView lap;
    Bytes letter;
    Floats value;
    Ints32 line;
    Floats extra;
    LabelView labels;
    Bytes statement_names;
    Ints32 statement_kinds;
    int64_t syntax;
    int64_t language;
} Program;

typedef struct {
    double bottom_mm;
    double corner_mm;
    double kappa_rad;
    double side_mm;
    double flute_mm;
} Shape;

typedef struct {
    Floats32 height;
    Ints32 wall;
    Floats32 bound;
    Ints32 visits;
    double x_mm;
    double y_mm;
    double dx_mm;
    double dy_mm;
    int64_t row;
    int64_t column;
    double bottom_mm;
} Grid;

typedef struct {
    Floats position_mm;
    Floats way_mm;
    Ints32 tool;
    Bools rapid;
    Bools first;
    Floats outlines;
} Path;

typedef struct {
    Floats position_mm;
    Floats direction;
    Floats way_mm;
    Floats f_z_mm;
    Ints32 tool;
    Ints point;
    Bools node;
} Samples;

typedef struct {
    Floats bands;
    Ints used;
    Ints wall_bins;
    Ints ring_bins;
    Floats teeth;
    Floats lag_mm;
    Floats above;
} Cutters;

typedef struct {
    Floats32 turn;
    Floats32 heading;
    Floats32 rows;
    Floats32 reach;
} Work;

typedef struct {
    Floats force_N;
    Floats moment_Nmm;
    Floats torque_Nmm;
    Floats a_p_mm;
    Floats a_e_mm;
    Floats phi_rad;
    Floats ramp_rad;
    Floats centre_mm;
    Floats overlap_mm;
    Bools is_read;
} Result;

typedef struct {
    Ints32 link;
    Floats ends_mm;
    Floats radius_mm;
    Floats lever_mm;
} Bodies;

typedef struct {
    Ints32 kind;
    Floats numbers;
    Ints tree;
    Floats triangles;
    Floats boxes;
} Obstacles;

typedef struct {
    Ints32 pairs;
    Bools known;
    Floats states;
    Floats ends_mm;
    Ints steps;
} Watched;

typedef struct {
    Floats pose;
    Bools ptp;
    Floats speed_mm_s;
    Floats cdis_mm;
    Floats wait_s;
} ReadMotions;

typedef struct {
    Floats position_mm;
    Floats rotation;
    Bools home;
    Ints32 tool;
    Bools ptp;
    Floats speed_mm_s;
    Floats cdis_mm;
    Floats wait_s;
} Wanted;

typedef struct {
    Floats largest;
    Ints taken;
    Ints row;
    Floats size;
    Ints worst_count;
    Ints worst;
    Floats worst_size;
    Floats worst_key;
} Noted;

#endif

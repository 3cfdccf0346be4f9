"""Bytes of ASCII by name, for the scanners of G-code and of KRL, which are C and take their codes from here.

Plain module constants: the compiled code takes their values from here.
"""

TAB, NEWLINE, RETURN, SPACE = 9, 10, 13, 32
END_OF_TAPE = 26
"""Control-Z, which old editors put behind the last line of a file."""
EXCLAMATION, QUOTE, HASH, DOLLAR, PERCENT, AMPERSAND = 33, 34, 35, 36, 37, 38
PAREN_OPEN, PAREN_CLOSE, ASTERISK = 40, 41, 42
PLUS, COMMA, MINUS, POINT, SLASH = 43, 44, 45, 46, 47
DIGIT_0, DIGIT_1, DIGIT_3, DIGIT_6, DIGIT_9 = 48, 49, 51, 54, 57
COLON, SEMICOLON, LESS, EQUALS, GREATER, QUESTION = 58, 59, 60, 61, 62, 63
AT_SIGN, CARET = 64, 94
LETTER_A, LETTER_C, LETTER_E, LETTER_F, LETTER_G = 65, 67, 69, 70, 71
LETTER_I, LETTER_J, LETTER_K = 73, 74, 75
LETTER_L, LETTER_M, LETTER_N, LETTER_O, LETTER_P = 76, 77, 78, 79, 80
LETTER_R, LETTER_S, LETTER_T = 82, 83, 84
LETTER_X, LETTER_Y, LETTER_Z = 88, 89, 90
BRACKET_OPEN, BRACKET_CLOSE, UNDERSCORE = 91, 93, 95
SMALL_A, SMALL_G, SMALL_M, SMALL_S, SMALL_Z = 97, 103, 109, 115, 122
BRACE_OPEN, BRACE_CLOSE, TILDE = 123, 125, 126
CASE_BIT = 32
"""Set in small letters, not set in capitals."""
FIRST_FOREIGN = 128
"""Bytes from here on are not ASCII."""

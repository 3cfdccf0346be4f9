"""What can be wrong with an expression or an O-word: a number for the core, a sentence and a remedy."""

(
    NO_VALUE,
    UNCLOSED_BRACKET,
    UNKNOWN_FUNCTION,
    UNKNOWN_OPERATOR,
    NO_BRACKET,
    NO_SLASH,
    NO_EQUALS,
    NAME_UNCLOSED,
    NAME_TOO_LONG,
    TOO_MANY_NAMES,
    TOO_DEEP,
    NO_PARAMETER,
    BEHIND_O_WORD,
) = range(13)

EXPRESSION_FAULTS: dict[int, tuple[str, str]] = {
    NO_VALUE: (
        "a number, # or [ is missing in the expression",
        "write a value; LinuxCNC's expressions stand in [ ]",
    ),
    UNCLOSED_BRACKET: ("a bracket of the expression is not closed", "add ]"),
    UNKNOWN_FUNCTION: (
        "this is not a function",
        "there are ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN",
    ),
    UNKNOWN_OPERATOR: (
        "an operator or ] is missing in the expression",
        "there are + - * / ** MOD AND OR XOR EQ NE GT GE LT LE",
    ),
    NO_BRACKET: ("[ is missing behind the function or the word", "write its argument in [ ]"),
    NO_SLASH: ("ATAN takes two arguments", "write ATAN[y]/[x]"),
    NO_EQUALS: ("a parameter stands alone, without =", "write #1 = value, or a letter before it"),
    NAME_UNCLOSED: ("the name of the parameter is not closed", "add >"),
    NAME_TOO_LONG: ("the name is longer than 255 characters", "shorten it"),
    TOO_MANY_NAMES: ("the program has more than 10000 names of parameters", "use numbered parameters"),
    TOO_DEEP: ("the expression has too many brackets within each other", "write it in several lines"),
    NO_PARAMETER: ("EXISTS asks for a parameter", "write EXISTS[#<name>]"),
    BEHIND_O_WORD: (
        "nothing but a comment may stand here, behind the O-word",
        "write it on a line of its own",
    ),
}

(
    DIVISION_BY_ZERO,
    SQUARE_ROOT,
    LOGARITHM,
    ARC_COSINE,
    ARC_SINE,
    POWER,
    NOT_A_NUMBER,
    INFINITE,
    IN_MACHINE_UNIT,
    OF_TOOL_TABLE,
    OF_OTHER_AXIS,
    FEED_OF_TIME,
    FEED_OF_OTHER_UNIT,
    TURNED_UNDER_SHIFT,
) = range(14)
VALUE_FAULTS: dict[int, str] = {
    DIVISION_BY_ZERO: "division by zero",
    SQUARE_ROOT: "the square root of {b:g} does not exist",
    LOGARITHM: "the logarithm of {b:g} does not exist",
    ARC_COSINE: "ACOS takes -1 to 1, here {b:g}",
    ARC_SINE: "ASIN takes -1 to 1, here {b:g}",
    POWER: "{b:g} is negative and cannot be raised to a power that is not whole",
    NOT_A_NUMBER: "the result is not a number",
    INFINITE: "the result is larger than any number",
    IN_MACHINE_UNIT: "#{b:.0f} is a length in the unit of the machine, which G20 does not tell",
    OF_TOOL_TABLE: "#{b:.0f} comes from the tool table of the control",
    OF_OTHER_AXIS: "#{b:.0f} belongs to a rotary or secondary axis, and is not kept here",
    FEED_OF_TIME: "#<_feed> under G93 is no feed, but what the move before made of it",
    TURNED_UNDER_SHIFT: "the place is not sure: G10 L2 R has turned the zero while G52 or G92 shifts it",
    FEED_OF_OTHER_UNIT: "#<_feed> was programmed in another unit, before G20 or G21",
}
VALUE_REMEDY = "check the parameters that the expression takes"
VALUE_REMEDIES: dict[int, str] = {
    IN_MACHINE_UNIT: "read it under G21, where it is in mm; or write the number itself",
    OF_TOOL_TABLE: "write the number itself",
    OF_OTHER_AXIS: "write the number itself",
    FEED_OF_TIME: "keep the number in a parameter of its own, #1 = 5 and F#1",
    TURNED_UNDER_SHIFT: "program X and Y behind G10, or end the shift before it (G92.1)",
    FEED_OF_OTHER_UNIT: "program F behind G20 or G21, in a line of its own",
}
"""Remedies of values that are known on the control and not here."""

(
    FAULT_LABEL,
    FAULT_WORD,
    FAULT_NO_OPENING,
    FAULT_NO_CLOSING,
    FAULT_CROSSED,
    FAULT_LABEL_TWICE,
    FAULT_NESTED_SUB,
    FAULT_NOT_IN_SUB,
    FAULT_NOT_IN_LOOP,
    FAULT_TWO_STYLES,
    FAULT_FILE_ENDS,
    FAULT_M99_IN_MAIN,
    FAULT_M98_WORDS,
    FAULT_SUB_TWICE,
    FAULT_CALL_NUMBER,
    FAULT_ARGUMENTS,
    FAULT_REPEATS,
    FAULT_NOT_FIRST,
    FAULT_BEHIND,
) = range(19)
O_WORD_FAULTS: dict[int, tuple[str, str]] = {
    FAULT_LABEL: ("O is not followed by a whole number or a <name>", "write O100 or O<name>"),
    FAULT_WORD: (
        "this is not an O-word",
        "there are sub endsub return call if elseif else endif while endwhile do repeat endrepeat break and "
        "continue",
    ),
    FAULT_NO_OPENING: ("this O-word has no beginning", "check the label: both ends have the same"),
    FAULT_NO_CLOSING: ("this O-word has no end", "add its end with the same label"),
    FAULT_BEHIND: (
        "nothing but a comment may stand behind this O-word",
        "check how the word is spelt; write other things on a line of their own",
    ),
    FAULT_CROSSED: ("this ends something that was begun outside of what is open here", "nest them"),
    FAULT_LABEL_TWICE: ("the label is used twice", "give each if, while, do and repeat a label of its own"),
    FAULT_NESTED_SUB: ("a subprogram is defined within another", "define it on its own"),
    FAULT_NOT_IN_SUB: ("this stands in no subprogram of this label", "check the label"),
    FAULT_NOT_IN_LOOP: ("this stands in no while or do loop of this label", "check the label"),
    FAULT_TWO_STYLES: (
        "call belongs to sub and endsub, M98 to a program O1000 that ends with M99",
        "call the subprogram in its own style",
    ),
    FAULT_FILE_ENDS: ("the file ends within a subprogram", "add endsub, or M99 where M98 calls it"),
    FAULT_M99_IN_MAIN: ("M99 in the main program would repeat it for ever", "end the program with M30"),
    FAULT_M98_WORDS: ("M98 takes P, the number of a program, and L, how often", "write M98 P1000 L2"),
    FAULT_SUB_TWICE: ("the subprogram is defined twice", "give it another label"),
    FAULT_CALL_NUMBER: ("the computed number of the subprogram is not whole", "check the expression"),
    FAULT_ARGUMENTS: ("a call takes at most 30 arguments", "pass the others in parameters"),
    FAULT_NOT_FIRST: (
        "an O-word, M98 or M99 stands behind other words",
        "write it on a line of its own",
    ),
    FAULT_REPEATS: ("more than 256 repeat loops are within each other", "write it otherwise"),
}

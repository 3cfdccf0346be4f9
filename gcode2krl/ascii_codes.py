"""Bytes with a meaning that no character shows, for the scanners, which are C and take them from here."""

END_OF_TAPE = 26
"""Control-Z, which old editors put behind the last line of a file."""
CASE_BIT = 32
"""Set in small letters, not set in capitals."""
FIRST_FOREIGN = 128
"""Bytes from here on are not ASCII."""

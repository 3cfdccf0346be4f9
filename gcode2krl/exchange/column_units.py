"""The unit of a column, read from the end of its name by one table.

The words are those that `pint` and `astropy.units` read. A column without a unit (a flag, a row number, a
component of a unit vector) has none.
"""

UNITS = {
    "_mm_s3": "mm/s^3",
    "_mm_s2": "mm/s^2",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_rad_s": "rad/s",
    "_rad": "rad",
    "_Nmm": "N*mm",
    "_N": "N",
    "_s": "s",
}
"""End of a name to its unit, a longer end before one that it ends in."""
SUFFIXES = tuple(UNITS)


def suffix_of(name: str) -> str:
    """Return the end of a name that states its unit, empty where there is none."""
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), "")


def unit_of(name: str) -> str | None:
    """Return the unit of a column, None where it has none.

    >>> from gcode2krl.exchange import unit_of
    >>> unit_of("acceleration_mm_s2"), unit_of("move")
    ('mm/s^2', None)
    """
    return UNITS.get(suffix_of(name))

"""The date on which a person confirmed the cell, against today's.

Only commands check this, and only for a finding: no written file may depend on the date.
"""

import datetime

from gcode2krl.cell.definition import Cell
from gcode2krl.errors import Issue

_TIME_ZONES = datetime.timedelta(days=1)
"""In other time zones it may already be tomorrow."""


def future_confirmation(cell: Cell, today: datetime.date | None = None) -> tuple[Issue, ...]:
    """Return a warning where ``verified`` names a future day; ``today`` is by default the clock's."""
    if cell.verified is None:
        return ()
    today = today if today is not None else datetime.datetime.now(datetime.UTC).date()
    if datetime.date.fromisoformat(cell.verified.date) <= today + _TIME_ZONES:
        return ()
    text = f"verified.date = {cell.verified.date} is in the future (today is {today})"
    remedy = "write the day on which verified.by confirmed the cell, or set this computer's clock"
    return (Issue("warning", "verified-future", 0, text, remedy, key="verified.date"),)

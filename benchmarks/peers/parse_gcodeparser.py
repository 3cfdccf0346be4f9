"""Parse a file with gcodeparser; print the seconds that parsing took and the blocks it found.

It knows no modal words: every line of the file must name its G.

python parse_gcodeparser.py part.nc
"""

import sys
import time
from pathlib import Path

from gcodeparser import parse_gcode_lines

with Path(sys.argv[1]).open(encoding="ascii") as file:
    start = time.perf_counter()
    found = list(parse_gcode_lines(file))
    print(time.perf_counter() - start, len(found))

"""Parse and interpret a file with pygcode; print the seconds that it took and the blocks that had words.

python parse_pygcode.py part.nc
"""

import sys
import time
from pathlib import Path

from pygcode import Line, Machine

lines = Path(sys.argv[1]).read_text(encoding="ascii").splitlines()
machine = Machine()
found = 0
start = time.perf_counter()
for line in lines:
    block = Line(line).block
    machine.process_block(block)
    found += bool(block.words)
print(time.perf_counter() - start, found)

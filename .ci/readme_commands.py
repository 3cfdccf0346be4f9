"""Print the set-up commands of the README: the lines of its ``sh setup`` blocks."""

import re
import sys
from pathlib import Path

text = Path(sys.argv[1]).read_text(encoding="utf-8")
for block in re.findall(r"^```sh setup\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL):
    print(block.strip())

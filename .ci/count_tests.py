"""Print how many tests passed in all runs of pytest whose output a file holds, as one closing line."""

import re
import sys
from pathlib import Path

text = Path(sys.argv[1]).read_text(encoding="utf-8")
counts = {
    outcome: sum(int(count) for count in re.findall(rf"\b(\d+) {outcome}\b.* in [\d.]+s", text))
    for outcome in ("passed", "failed", "skipped")
}
print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))

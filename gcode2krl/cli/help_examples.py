"""The examples at the end of a help text; each line runs in tests/cli/test_help_examples.py."""

HEADING = "Examples:"


def examples(*lines: str) -> str:
    """Return the epilog of a command: lines as typed, which click must not wrap."""
    return "\b\n" + "\n".join([HEADING, *(f"  {line}" for line in lines)])


def lines_of(epilog: str | None) -> list[str]:
    """Return the commands of an epilog."""
    _, _, below = (epilog or "").partition(f"{HEADING}\n")
    return [line.strip() for line in below.splitlines() if line.strip()]

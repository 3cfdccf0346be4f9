"""Words and blocks of random G-code, written as posts and hands write them: `.5`, `+5.`, `x 1.50`."""

from collections.abc import Sequence
from typing import Any

import numpy as np


class Words:
    """The lines of a program, and the modes that say what a word means."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.lines: list[str] = []
        self.inches, self.feed_mode = False, 94

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one_of(self, choices: Sequence[Any]) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def size(self, low: float, high: float) -> float:
        """Return a length in the unit in force, rounded as a post rounds."""
        value = float(self.rng.uniform(low, high)) / (25.4 if self.inches else 1.0)
        return round(value, int(self.rng.integers(0 if not self.inches else 2, 6)))

    def number(self, value: float) -> str:
        text = f"{value:.7f}".rstrip("0")
        text = text.rstrip(".") if self.chance(0.6) else text
        if text.startswith(("0.", "-0.")) and len(text.partition(".")[2]) > 0 and self.chance(0.3):
            text = text.replace("0.", ".", 1)
        if text in ("-0", "-0.", ""):
            text = "0"
        return f"+{text}" if value > 0 and self.chance(0.05) else text

    def word(self, letter: str, value: float) -> str:
        blank = " " if self.chance(0.05) else ""
        return f"{letter}{blank}{self.number(value)}"

    def block(self, *words: str) -> None:
        text = (" " if self.chance(0.8) else "").join(word for word in words if word)
        if self.chance(0.05):
            text = text.lower()
        if self.chance(0.1):
            text = f"N{len(self.lines) * 5 + 5} {text}"
        if self.chance(0.05):
            text += self.one_of([" (a comment)", " ; tail", "(x1)", "\t"])
        if self.chance(0.03):
            text = f"/{text}"
        self.lines += [text] if self.chance(0.97) else [text, ""]

    def feed_word(self) -> str:
        """Return F where the feed mode wants one in each block, or by chance."""
        if self.feed_mode == 93:
            return self.word("F", self.size(1.0, 60.0) + 0.5)
        return (
            self.word("F", self.size(0.05, 2.0) + 0.01 if self.feed_mode == 95 else self.size(50, 3000) + 1)
            if self.chance(0.3)
            else ""
        )

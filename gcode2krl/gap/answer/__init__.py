"""The answer: typed, in words, as JSON, into a cell file, as pictures."""

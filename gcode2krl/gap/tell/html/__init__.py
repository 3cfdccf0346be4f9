"""The answer as one page that needs no network."""

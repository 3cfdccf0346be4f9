"""The answer to look at: pictures of the runs, and one page that needs no network."""

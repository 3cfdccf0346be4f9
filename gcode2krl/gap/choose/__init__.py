"""Which effects are at work, how sure, and how much they explain."""

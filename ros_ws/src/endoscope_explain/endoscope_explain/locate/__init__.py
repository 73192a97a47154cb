"""Where a mismatch is, before and after it has a name."""

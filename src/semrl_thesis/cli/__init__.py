"""Commands that this package adds to ``semrl``, by entry points."""

"""Pages about the thesis done again."""

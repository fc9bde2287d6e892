"""The tests, tables and figures of thesis chapter 4, and the figures of its method: ``semrl reproduce``."""

"""The command line: ``semrl train``, ``eval``, ``report``, ``doctor``."""

from semrl.cli.main import main

__all__ = ["main"]

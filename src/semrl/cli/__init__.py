"""The command line: ``semrl train``, ``eval``, ``report``, ``map``, ``query``, ``explain``, ``doctor``."""

from semrl.cli.main import main

__all__ = ["main"]

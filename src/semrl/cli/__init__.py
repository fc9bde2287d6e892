"""The command line, ``semrl COMMAND``: one file each."""

from semrl.cli.main import main

__all__ = ["main"]

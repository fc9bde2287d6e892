"""Runs that are stopped on the way."""

import signal

import pytest

from semrl.core.errors import SemrlError
from semrl.training import train


class StopAt:
    """Stops a run after a decision, as Ctrl-C would."""

    def __init__(self, decision):
        self.decision = decision

    def on_decision(self, trainer):
        if trainer.decisions_ == self.decision:
            signal.raise_signal(signal.SIGINT)

    def on_row(self, row):
        pass


def stopped(path, config, decision):
    with pytest.raises(SemrlError, match="stopped"):
        train(path, config, observers=[StopAt(decision)])
    return path

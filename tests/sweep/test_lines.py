"""How far the runs of a sweep are, told every half minute."""

import re

from semrl.sweep import Task
from semrl.sweep import engine as engines
from semrl.training import train


def test_the_queue_tells_how_far_its_runs_are(tmp_path, tiny):
    said, config = [], tiny("baseline", decisions=10)
    train(tmp_path / "whole", config)
    tasks = [Task(id=f"otsu-{name}", run=tmp_path / name, config=config) for name in ("whole", "none", "waits")]
    queue = engines._Queue(tasks, None, say=said.append, show=None, on_finished=None)
    queue.states[0].status = queue.states[1].status = "running"
    queue._print()
    assert said == []  # not half a minute has passed
    queue._printed -= engines.EVERY_SECONDS
    queue._print()
    queue._print()
    assert len(said) == 2 and re.match(r"otsu-whole: .* agent: 10 of 10 decisions", said[0])
    assert said[1] == "otsu-none: has not reported yet how far it is"

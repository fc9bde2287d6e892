"""How far the runs of a queue are, told every half minute."""

import re

from semrl.training import train
from semrl_thesis import queue


def test_the_queue_tells_how_far_its_runs_are(tmp_path, tiny):
    said = []
    jobs = queue.Queue(tmp_path, workers=1, say=said.append)
    train(tmp_path / "whole", tiny("baseline", decisions=10))
    spec = type("Spec", (), {"id": "thesis-otsu-0"})()
    for name in ("whole", "none"):
        jobs._jobs.append(queue._Job(spec=spec, process=None, said=None, run=tmp_path / name))
    jobs._tell_how_far()
    assert said == []  # not half a minute has passed
    jobs._told -= queue.EVERY_SECONDS
    jobs._tell_how_far()
    jobs._tell_how_far()
    assert len(said) == 2 and re.match(r"thesis-otsu-0: .* agent: 10 of 10 decisions", said[0])
    assert said[1] == "thesis-otsu-0: has not told yet how far it is"

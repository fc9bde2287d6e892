"""Many runs: what to train as data, engines that train it side by side, and the scores of all."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.sweep.engine import Pool, TaskState, run_all
    from semrl.sweep.local import LocalPool
    from semrl.sweep.on_ray import RayPool
    from semrl.sweep.task import Task
    from semrl.sweep.trials import Trial

_HOME = {
    "LocalPool": "semrl.sweep.local",
    "Pool": "semrl.sweep.engine",
    "RayPool": "semrl.sweep.on_ray",
    "Task": "semrl.sweep.task",
    "TaskState": "semrl.sweep.engine",
    "Trial": "semrl.sweep.trials",
    "run_all": "semrl.sweep.engine",
}

__all__ = ["LocalPool", "Pool", "RayPool", "Task", "TaskState", "Trial", "run_all"]

__getattr__, __dir__ = lazily(__name__, _HOME)

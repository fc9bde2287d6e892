"""A trained run as a folder to be shared: what play needs, its results, and a model card."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.training.folder import RunFolder

KEPT = ("format", "model", "env", "seed", "versions", "threads", "environment", "status", "hashes", "result")
"""What is published of a run: not on which machine it was trained."""


def publish(run: str | Path, to: str | Path) -> RunFolder:
    """Copy what play needs of a finished run into a new folder, and its evaluations.

    The folder is a run again: whatever reads runs, such as `load_player` and `load_encoder`, reads it.

    Parameters
    ----------
    run
        Its folder.
    to
        The new folder.

    Raises
    ------
    UsageError
        When there is no such run, it is not finished, or the new folder exists.
    SemrlError
        When a file of the run is damaged.
    """
    source, path = RunFolder.open(Path(run)), Path(to)
    manifest = source.manifest()
    if manifest["status"] != "finished":
        further = f"; go on with: {source.resuming}" if source.resuming else ""
        raise UsageError(f"{run} is not finished, so there is nothing to publish yet{further}")
    checkpoint = source.newest(play_only=True)
    folder = RunFolder.create(path, source.config())
    try:
        folder.write_manifest({name: manifest[name] for name in KEPT if name in manifest} | _without_path(manifest))
        folder.save(replace(checkpoint, metrics_rows=0))
        for evaluation in sorted(source.path.glob("evaluation*.json")):
            write_text(path / evaluation.name, _evaluation(evaluation))
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)  # half a model would pass for a whole one
        raise
    return folder


def _without_path(manifest: dict[str, object]) -> dict[str, object]:
    """Return the result without the folder that it was trained in."""
    result = manifest["result"]
    assert isinstance(result, dict)
    return {"result": {**result, "run": ""}}


def _evaluation(path: Path) -> str:
    """Return an evaluation without the folder that it was made in."""
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        return dumps({**result, "run": ""}, indent=2) + "\n"
    except (ValueError, TypeError) as error:
        raise SemrlError(f"{path} is damaged: {error!r}; delete it and evaluate again") from None

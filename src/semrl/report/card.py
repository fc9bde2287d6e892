"""The model card of a published run: Markdown with a head of metadata, as model hubs read it."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from semrl.core.errors import SemrlError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.report import wording
from semrl.report.record import RunRecord, read_run
from semrl.world_model.rules import Rule, sentence

RULES_SHOWN = 8


def write_card(folder: Path, rules: Sequence[Rule]) -> Path:
    """Write ``README.md`` into the folder of a published run.

    Parameters
    ----------
    folder
        See `semrl.evaluation.publishing.publish`.
    rules
        Some that it predicts by; none where it has none.

    Raises
    ------
    SemrlError
        When a file is damaged, or the card cannot be written.
    """
    record = read_run(folder)
    scores = {path.stem: _score(path) for path in sorted(folder.glob("evaluation*.json"))}
    write_text(folder / "README.md", _head(record, scores) + _body(record, scores, rules))
    return folder / "README.md"


def _score(path: Path) -> Mapping[str, Any]:
    try:
        score = json.loads(path.read_text(encoding="utf-8"))
        return {name: score[name] for name in ("policy", "episodes", "mean", "std", "min", "max", "conditions")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SemrlError(f"{path} is damaged: {error!r}; delete it and evaluate again") from None


def _head(record: RunRecord, scores: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the metadata; every value is JSON, which YAML contains."""
    game, model = wording.game(record), record.manifest["model"]
    results = [
        {
            "task": {"type": "reinforcement-learning", "name": "reinforcement-learning"},
            "dataset": {"name": game, "type": record.manifest["env"]},
            "metrics": [
                {
                    "type": "mean_reward",
                    "name": name,
                    "value": f"{score['mean']:.2f} +/- {score['std']:.2f}",
                    "verified": False,
                }
            ],
        }
        for name, score in scores.items()
    ]
    tags = ["reinforcement-learning", "neuro-symbolic", "semrl", game, model]
    values: dict[str, Any] = {"library_name": "semrl", "pipeline_tag": "reinforcement-learning", "tags": tags}
    if results:
        values["model-index"] = [{"name": f"{model}-{game.lower()}", "results": results}]
    return "\n".join(["---", *(f"{name}: {dumps(value)}" for name, value in values.items()), "---", ""])


def _body(record: RunRecord, scores: Mapping[str, Mapping[str, Any]], rules: Sequence[Rule]) -> str:
    manifest, result = record.manifest, record.manifest["result"]
    lines = [
        f"# {manifest['model']} on {wording.game(record)}",
        "",
        f"A neuro-symbolic agent, trained with semrl in `{manifest['env']}` for {result['decisions']:,} decisions "
        f"({result['frames']:,} frames), seed {manifest['seed']}.",
        "",
        "## Use",
        "",
        "    semrl eval FOLDER --video play.mp4    # play",
        "    semrl rules FOLDER                    # what it has learned of its world",
        "",
        "```python",
        "from semrl.evaluation import load_encoder, load_player",
        "",
        'player = load_player("FOLDER")      # agent, planner and perception',
        'encoder = load_encoder("FOLDER")    # perception alone, for SemanticObservation',
        "```",
        "",
        "The arrays in `checkpoints/` are plain numpy archives; nothing in this folder is unpickled or evaluated.",
        "",
        "## Results",
        "",
        *_table(scores),
        "",
    ]
    if rules:
        lines += ["## What it has learned", "", *(f"- {rule.about}: {sentence(rule)}" for rule in rules), ""]
    versions = ", ".join(f"{name} {value}" for name, value in manifest["versions"].items())
    hashes = manifest.get("hashes", {})
    lines += [
        "## Made with",
        "",
        f"{versions}; all settings are in `config.toml`. Digest of the weights: `{hashes.get('weights', '?')}`.",
        "",
    ]
    return "\n".join(lines)


def _table(scores: Mapping[str, Mapping[str, Any]]) -> list[str]:
    if not scores:
        return ["It was not evaluated before it was published."]
    rows = [
        f"| {name} | {s['policy']} | {s['episodes']} | {s['mean']:.2f} | {s['std']:.2f} | {s['min']:g} | {s['max']:g} |"
        for name, s in scores.items()
    ]
    head = "| evaluation | who decides | episodes | mean return | standard deviation | least | most |"
    return [head, "|---|---|---|---|---|---|---|", *rows, "", "Conditions of each are in the file of its name."]

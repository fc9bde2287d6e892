"""``semrl report``: one page about one or more runs."""

import json as json_format
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.markup import escape

from semrl.cli.arguments import parse
from semrl.cli.progress import console, error_console, summary
from semrl.core.errors import MissingExtraError, NoEnvironmentError, UsageError
from semrl.evaluation.gallery import save_gallery
from semrl.report import write_report
from semrl.training import RunConfig, RunFolder
from semrl.training.config import to_dict


@dataclass(frozen=True, kw_only=True)
class ReportArguments:
    """Write one self-contained HTML page: results, curves, what was seen, settings, provenance."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of the runs; several are compared."""
    out: Path | None = None
    """The page [default: report.html in the run's folder, or here for several runs]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, look at what is missing, write, tell."""
    arguments = parse(ReportArguments, argv, command="report")
    if not arguments.runs:
        raise UsageError("report needs the folder of at least one run; see semrl report --help")
    folders = [RunFolder.open(run) for run in arguments.runs]
    out = arguments.out or (arguments.runs[0] if len(folders) == 1 else Path()) / "report.html"
    for folder in folders:
        folder.config()  # a damaged one is told before anything is made
        _make_gallery(folder)
    page = write_report(arguments.runs, out, defaults=to_dict(RunConfig()))
    if arguments.json:
        print(json_format.dumps({"report": str(page), "runs": [str(run) for run in arguments.runs]}))
        return
    console.print(summary({"report": page.resolve().as_uri()}))


def _make_gallery(folder: RunFolder) -> None:
    """Look at some frames with the run's newest perception, if that was not done yet and there is one."""
    gallery = folder.path / "gallery.npz"
    checkpoints = folder.checkpoints()
    if not checkpoints or (gallery.exists() and gallery.stat().st_mtime >= checkpoints[-1].stat().st_mtime):
        return
    with error_console.status(f"looking at frames with the perception of {folder.path}"):
        try:
            save_gallery(folder.path, folder.config().seed)
        except (NoEnvironmentError, MissingExtraError) as error:  # what was learned is told without frames
            error_console.print(f"no frames of {escape(str(folder.path))}: {escape(str(error))}", soft_wrap=True)

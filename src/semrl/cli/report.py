"""``semrl report``: one page about one or more runs."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.markup import escape

from semrl.cli.arguments import parse
from semrl.cli.progress import error_console, show_summary
from semrl.core.errors import MissingExtraError, NoEnvironmentError, SemrlWarning, UsageError
from semrl.core.files import require_writable
from semrl.core.strict_json import dumps
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
    """Parse, look at what is missing, write, print."""
    arguments = parse(ReportArguments, argv, command="report")
    if not arguments.runs:
        raise UsageError("report needs the folder of at least one run; see semrl report --help")
    folders = [RunFolder.open(run) for run in arguments.runs]
    out = arguments.out or (arguments.runs[0] if len(folders) == 1 else Path()) / "report.html"
    require_writable(out)
    for folder in folders:
        folder.config()  # a damaged one is refused before anything is made
        _make_gallery(folder)
    page = write_report(arguments.runs, out, defaults=to_dict(RunConfig()))
    if arguments.json:
        print(dumps({"report": str(page), "runs": [str(run) for run in arguments.runs]}))
        return
    show_summary({"report": page.resolve().as_uri()})


def _make_gallery(folder: RunFolder) -> None:
    """Look at some frames with the run's newest perception, if that was not done yet and there is one."""
    gallery = folder.path / "gallery.npz"
    checkpoints = folder.checkpoints()
    if not checkpoints or (gallery.exists() and gallery.stat().st_mtime >= checkpoints[-1].stat().st_mtime):
        return
    try:
        require_writable(gallery)
    except UsageError as error:
        warnings.warn(f"{error}; the page shows no frames of this run", SemrlWarning, stacklevel=2)
        return
    with error_console.status(f"looking at frames with the perception of {folder.path}"):
        try:
            save_gallery(folder.path, folder.config().seed)
        except (NoEnvironmentError, MissingExtraError) as error:  # what was learned is reported without frames
            error_console.print(f"no frames of {escape(str(folder.path))}: {escape(str(error))}", soft_wrap=True)

"""``semrl completion``: what a shell needs to complete commands and options."""

import contextlib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import tyro

from semrl.cli.arguments import parse

Shell = Literal["bash", "zsh"]


@dataclass(frozen=True, kw_only=True)
class CompletionArguments:
    """Print a script that lets bash or zsh complete commands and options of semrl; paths are completed as ever.

    For example
      semrl completion bash > ~/.local/share/bash-completion/completions/semrl
      semrl completion zsh > ~/.zfunc/_semrl      # with fpath+=~/.zfunc before compinit in ~/.zshrc
    """

    shell: tyro.conf.Positional[Shell]
    """Which shell."""


def main(argv: Sequence[str]) -> None:
    """Parse, ask every command for its options, print."""
    arguments = parse(CompletionArguments, argv, command="completion")
    from semrl.cli.main import load_command, summaries  # late: it imports this module by name

    texts = summaries()
    options = {name: _options(load_command(name)) for name in texts}
    print(_bash(options) if arguments.shell == "bash" else _zsh(options, texts))


def _options(main: object) -> list[str]:
    """Return the options that the help of a command names."""
    said = io.StringIO()
    assert callable(main)
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        main(["--help"])
    plain = re.sub(r"\x1b\[[0-9;]*m", "", said.getvalue())
    found = re.findall(r"(?:^|[\s│,{|])(--[a-z0-9][\w.-]*\w)", plain)
    return sorted(dict.fromkeys(found))


def _bash(options: Mapping[str, Sequence[str]]) -> str:
    cases = "\n".join(f'        {name}) words="{" ".join(some)}" ;;' for name, some in options.items())
    return f"""# completion of semrl for bash
_semrl() {{
    local words= current="${{COMP_WORDS[COMP_CWORD]}}"
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{" ".join(options)} --help --version" -- "$current"))
        return
    fi
    case "${{COMP_WORDS[1]}}" in
{cases}
    esac
    case "$current" in
        -*) COMPREPLY=($(compgen -W "$words" -- "$current")) ;;
    esac
}}
complete -o default -F _semrl semrl"""


def _zsh(options: Mapping[str, Sequence[str]], texts: Mapping[str, str]) -> str:
    def quoted(text: str) -> str:
        return "'" + text.replace("'", "'\\''") + "'"

    described = "\n".join(f"        {quoted(f'{name}:{text}')}" for name, text in texts.items())
    cases = "\n".join(f"        {name}) options=({' '.join(some)}) ;;" for name, some in options.items())
    return f"""#compdef semrl
# completion of semrl for zsh
_semrl() {{
    local -a commands options
    commands=(
{described}
    )
    if (( CURRENT == 2 )); then
        _describe command commands
        return
    fi
    case $words[2] in
{cases}
    esac
    if [[ $PREFIX == -* ]]; then
        compadd -a options
    else
        _files
    fi
}}
# As a file of fpath it is run by the first completion, which it must answer itself.
if [[ $funcstack[1] == _semrl ]]; then _semrl "$@"; else compdef _semrl semrl; fi"""

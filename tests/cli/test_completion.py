"""`semrl completion`: scripts that shells take, and that complete what there is."""

import shutil
import subprocess

import pytest

from semrl.cli.main import COMMANDS


@pytest.fixture(scope="module")
def scripts():
    import contextlib
    import io

    from semrl.cli import main

    told = {}
    for shell in ("bash", "zsh"):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            assert main(["completion", shell]) == 0
        told[shell] = said.getvalue()
    return told


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_every_command_has_its_options(scripts, shell):
    assert all(name in scripts[shell] for name in COMMANDS)
    for option in ("--policy", "--episodes", "--dqn.n-steps", "--planning.world-model", "--no-browser", "--json"):
        assert option in scripts[shell]
    assert "\x1b" not in scripts[shell]


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["semrl", "wat"], {"watch"}),
        (["semrl", "ex"], {"explain", "export"}),
        (["semrl", "watch", "--po"], {"--policy", "--port"}),
        (["semrl", "sweep", "x.toml", "--wor"], {"--workers"}),
        (["semrl", "watch", "runs/"], set()),
        (["semrl", "nothing", "--x"], set()),
    ],
)
def test_bash_completes(scripts, words, wanted):
    line = " ".join(f"'{word}'" for word in words)
    asked = f"COMP_WORDS=({line})\nCOMP_CWORD={len(words) - 1}\n_semrl\nprintf '%s\\n' \"${{COMPREPLY[@]}}\""
    script = f"{scripts['bash']}\n{asked}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == wanted and not done.stderr


@pytest.mark.skipif(not shutil.which("zsh"), reason="there is no zsh")
def test_zsh_takes_the_script(scripts):
    done = subprocess.run(["zsh", "-n"], input=scripts["zsh"], capture_output=True, text=True, check=True)
    assert not done.stderr


def test_other_shells_are_told(call):
    assert "fish" in call("completion", "fish").message and call("completion").status == 2


@pytest.mark.skipif(not shutil.which("zsh"), reason="there is no zsh")
def test_the_first_tab_of_a_new_zsh_completes(scripts, tmp_path):
    (tmp_path / "_semrl").write_text(scripts["zsh"])
    typing = r"""
        zmodload zsh/zpty
        zpty shell zsh -f -i
        zpty -w shell "fpath=($1 \$fpath); autoload -Uz compinit; compinit -u -D"
        zpty -w shell "bindkey '^I' complete-word; print rea''dy"
        zpty -r shell shown '*ready*'
        zpty -w -n shell $'semrl tra\t'
        zpty -r shell shown '*semrl*train*'
        print -r -- $shown
        zpty -d shell
    """
    done = subprocess.run(
        ["zsh", "-fc", typing, "zsh", tmp_path], capture_output=True, text=True, check=True, timeout=60
    )
    assert "train" in done.stdout

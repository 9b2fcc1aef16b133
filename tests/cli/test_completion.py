"""Tab completion: the scripts are run by the shells themselves, those of zsh and fish where the shell is there."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from lhdmap.cli.completion_scripts import bash, fish, zsh
from lhdmap.cli.completion_tree import CompletionNode, all_nodes
from lhdmap.cli.main import COMMANDS, main
from lhdmap.config import setting_names

# What stands on the line (the last word is the one that TAB is pressed in), and what is offered.
OFFERS = [
    (["bu"], ["build-map"]),
    (["build-map", "dri"], ["dri ve.mcap", "drive.mcap"]),
    (["build-map", "drive.mcap", "-o", "su"], ["sub"]),
    (["build-map", "--o"], ["--one-process", "--output"]),
    (["build-map", "x", "--set", "odometry.step_"], [f"odometry.step_{unit}=" for unit in ("deg", "m", "s")]),
    (["build-map", "x", "--topic", "fro"], ["front="]),
    (["build-map", "x", "--poses", "gro"], ["ground-truth"]),
    (["eval", "t"], ["trajectory"]),
    (["eval", "loc"], ["localization"]),
    (["localize", "drive.mcap", "--ma"], ["--machine", "--map"]),
    (["localize", "drive.mcap", "--map", "su"], ["sub"]),
    (["eval", "trajectory", "--alignment", "s"], ["se2", "se3"]),
    (["eval", "trajectory", "--delta", ""], []),
    (["rockbreaker", "plan", "--timing", "paper"], ["paper", "paper-best"]),
    (["config", "pi"], ["pile"]),
    (["completion", "f"], ["fish"]),
    (["simulate", "gr"], ["grizzly"]),
]


@pytest.fixture(scope="module")
def nodes() -> list[CompletionNode]:
    return all_nodes()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder to complete paths in."""
    for name in ("drive.mcap", "dri ve.mcap"):
        (tmp_path / name).touch()
    (tmp_path / "sub").mkdir()
    return tmp_path


def offered(shell: str, script: str, code: str, folder: Path, words: list[str]) -> list[str]:
    """Return what the shell says, line by line."""
    (folder / "script").write_text(script, encoding="utf-8")
    options = {"bash": ["--norc"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    command = [shell, *options, "-c", code, *([shell] if shell != "fish" else []), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return [line for line in done.stdout.splitlines() if line not in ("", "script")]


BASH = """\
source ./script; complete -p lhdmap > /dev/null
COMP_WORDS=(lhdmap "$@"); COMP_CWORD=$#
_lhdmap 2> /dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(("words", "wanted"), OFFERS, ids=" ".join)
def test_bash_offers(words: list[str], wanted: list[str], nodes: list[CompletionNode], folder: Path) -> None:
    assert sorted(offered("bash", bash(nodes), BASH, folder, words)) == sorted(wanted)


def test_bash_offers_behind_an_equals_sign(nodes: list[CompletionNode], folder: Path) -> None:
    """Bash parts words at `=`."""
    assert offered("bash", bash(nodes), BASH, folder, ["build-map", "--output", "=", "su"]) == ["sub"]
    assert len(offered("bash", bash(nodes), BASH, folder, ["build-map", "--output", "="])) == 3


@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
@pytest.mark.parametrize(("words", "wanted"), OFFERS, ids=" ".join)
def test_fish_offers(words: list[str], wanted: list[str], nodes: list[CompletionNode], folder: Path) -> None:
    line = " ".join(["lhdmap", *words])
    found = offered("fish", fish(nodes), f"source ./script; complete -C '{line}'", folder, [])
    assert sorted(one.split("\t")[0].rstrip("/") for one in found) == sorted(wanted)


ZSH = """\
compdef() {}; compset() {}
_files() { print -l -- ${words[CURRENT]}*(N) }
compadd() {
    while [[ $1 != -- ]]; do shift; done
    shift; for one; do [[ $one == ${words[CURRENT]}* ]] && print -r -- $one; done; true
}
source ./script
words=(lhdmap "$@"); CURRENT=$#words
_lhdmap
"""


@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not installed")
@pytest.mark.parametrize(("words", "wanted"), OFFERS, ids=" ".join)
def test_zsh_offers(words: list[str], wanted: list[str], nodes: list[CompletionNode], folder: Path) -> None:
    """With stand-ins for the functions of its completion system, which only run at a terminal."""
    assert sorted(offered("zsh", zsh(nodes), ZSH, folder, words)) == sorted(wanted)


@pytest.mark.parametrize("write", [bash, zsh, fish])
def test_all_commands_and_settings_are_in_the_scripts(write: object, nodes: list[CompletionNode]) -> None:
    assert callable(write)
    script = write(nodes)
    assert {node.path for node in nodes} >= {*COMMANDS, "eval/trajectory", "rockbreaker/plan"}
    for name in (*COMMANDS, *setting_names()):
        assert name in script


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_command_prints_the_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert f"lhdmap for {shell}" in capsys.readouterr().out
    assert "import lhdmap" not in bash(all_nodes()), "nothing is asked of lhdmap when TAB is pressed"

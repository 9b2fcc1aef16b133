"""The scripts that complete words for bash, zsh and fish: one case for each command, nothing is asked of lhdmap."""

from __future__ import annotations

from collections.abc import Sequence

from lhdmap.cli.completion_tree import CompletionNode, Option, Values

_BASH = """\
# Tab completion of lhdmap for bash: source <(lhdmap completion bash)
_lhdmap_files() {{
    compopt -o filenames 2>/dev/null
    local line
    while IFS= read -r line; do COMPREPLY+=("$line"); done < <(compgen -f -- "$cur")
}}
_lhdmap_words() {{
    COMPREPLY+=($(compgen -W "$1" -- "$cur"))
    [[ ${{COMPREPLY[0]}} == *= ]] && compopt -o nospace 2>/dev/null
}}
_lhdmap() {{
    local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} command= i
    COMPREPLY=()
    if [[ $cur == = ]]; then cur=; elif [[ $prev == = ]]; then prev=${{COMP_WORDS[COMP_CWORD-2]}}; fi
    for ((i = 1; i < COMP_CWORD; i++)); do
        case "$command/${{COMP_WORDS[i]}}" in
            {paths}) command=${{command:+$command/}}${{COMP_WORDS[i]}} ;;
        esac
    done
    case "$command" in
{cases}
    esac
}}
complete -F _lhdmap lhdmap
"""

_ZSH = """\
#compdef lhdmap
# Tab completion of lhdmap for zsh: source <(lhdmap completion zsh), after compinit
_lhdmap_words() {{
    local -a open=(${{(M)@:#*=}}) whole=(${{@:#*=}})
    if (( $#open )); then compadd -S '' -- $open; fi
    if (( $#whole )); then compadd -- $whole; fi
}}
_lhdmap() {{
    local command= prev=$words[CURRENT-1] i
    for ((i = 2; i < CURRENT; i++)); do
        case "$command/$words[i]" in
            {paths}) command=${{command:+$command/}}$words[i] ;;
        esac
    done
    if [[ $words[CURRENT] == --*=* ]]; then
        prev=${{words[CURRENT]%%=*}}
        compset -P '*='
    fi
    case "$command" in
{cases}
    esac
}}
if [[ $funcstack[1] == _lhdmap ]]; then _lhdmap "$@"; else compdef _lhdmap lhdmap; fi
"""

_FISH = """\
# Tab completion of lhdmap for fish: lhdmap completion fish | source
function __lhdmap_at
    set -l path ""
    for word in (commandline -opc)[2..-1]
        set -l next (string trim -l -c / -- "$path/$word")
        if contains -- "$next" {paths}
            set path $next
        end
    end
    test "$path" = "$argv[1]"
end
complete -c lhdmap -f
{lines}
"""


def bash(nodes: Sequence[CompletionNode]) -> str:
    """Return the script for bash."""
    return _BASH.format(paths=_paths(nodes), cases="\n".join(_case(node, "_lhdmap_files", "$cur") for node in nodes))


def zsh(nodes: Sequence[CompletionNode]) -> str:
    """Return the script for zsh."""
    cases = "\n".join(_case(node, "_files", "$words[CURRENT]", each_word=True) for node in nodes)
    return _ZSH.format(paths=_paths(nodes), cases=cases)


def fish(nodes: Sequence[CompletionNode]) -> str:
    """Return the script for fish."""
    lines = [line for node in nodes for line in _fish_lines(node)]
    return _FISH.format(paths=" ".join(node.path for node in nodes if node.path), lines="\n".join(lines))


def _paths(nodes: Sequence[CompletionNode]) -> str:
    """Return the pattern of all commands as `COMMAND/WORD`: that of the first level begins with the stroke."""
    return "|".join(node.path if "/" in node.path else f"/{node.path}" for node in nodes if node.path)


def _case(node: CompletionNode, files: str, current: str, *, each_word: bool = False) -> str:
    """Return what is completed behind a command: values of the option before, options, commands or arguments."""
    inner = [
        f"                {'|'.join(one.names)}) {_offer(one.values, files, each_word=each_word)} ;;"
        for one in node.options
        if one.values is not None
    ]
    options = Values(tuple(name for one in node.options for name in one.names))
    rest = Values(tuple(node.commands)) if node.commands else node.arguments
    return "\n".join(
        [
            f"        {node.path or repr('')})",
            '            case "$prev" in',
            *inner,
            f"                *) if [[ {current} == -* ]]; then {_offer(options, files, each_word=each_word)}",
            f"                   else {_offer(rest, files, each_word=each_word)}; fi ;;",
            "            esac ;;",
        ]
    )


def _offer(values: Values, files: str, *, each_word: bool) -> str:
    words = " ".join(values.words)
    steps = [f"_lhdmap_words {words if each_word else _quoted(words)}"] if words else []
    return "; ".join([*steps, *([files] if values.files else [])]) or ":"


def _fish_lines(node: CompletionNode) -> list[str]:
    start = f"complete -c lhdmap -n \"__lhdmap_at '{node.path}'\""
    lines = [f"{start} -a {name} -d {_quoted(text)}" for name, text in node.commands.items()]
    lines += [f"{start} {_fish_values(node.arguments)}"] if node.arguments != Values() and not node.commands else []
    return [*lines, *(f"{start} {_fish_option(one)}" for one in node.options)]


def _fish_option(option: Option) -> str:
    names = [f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names]
    values = [] if option.values is None else ["-r", _fish_values(option.values)]
    return " ".join([*names, *values, f"-d {_quoted(option.text)}"])


def _fish_values(values: Values) -> str:
    words = f"-a {_quoted(' '.join(values.words))}" if values.words else ""
    return " ".join(part for part in ("-F" if values.files else "-f", words) if part)


def _quoted(text: str) -> str:
    """Return the text in single quotes; an apostrophe becomes a typographic one, so that every shell agrees."""
    return "'" + text.replace("'", "’").replace("\\", "/") + "'"

"""``gcode2krl completion SHELL``: the script that lets a shell complete commands, options and files."""

import contextlib
import os
import shlex
from typing import Any

import click
from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, get_completion_class

from gcode2krl.cli.help_examples import examples

PROGRAM = "gcode2krl"
VARIABLE = "_GCODE2KRL_COMPLETE"
SHELLS = ("bash", "zsh", "fish", "powershell")
_POWERSHELL = """\
Register-ArgumentCompleter -Native -CommandName %(prog_name)s -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)
    $line = $commandAst.ToString()
    $end = [Math]::Min($line.Length, $cursorPosition - $commandAst.Extent.StartOffset)
    $env:COMP_WORDS = $line.Substring(0, $end)
    $env:COMP_CWORD = $wordToComplete
    $env:%(complete_var)s = 'powershell_complete'
    try {
        %(prog_name)s | Where-Object { $_ } | ForEach-Object {
            $value, $help = $_ -split "`t", 2
            if (-not $help) { $help = $value }
            [System.Management.Automation.CompletionResult]::new($value, $value, 'ParameterValue', $help)
        }
    } finally {
        Remove-Item Env:COMP_WORDS, Env:COMP_CWORD, Env:%(complete_var)s
    }
}
"""


class PowerShellComplete(ShellComplete):
    """Completion for PowerShell 5.1 and later, which click does not bring along.

    Files are not answered: where a completer says nothing, PowerShell offers files itself.
    """

    name = "powershell"
    source_template = _POWERSHELL

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the cursor's, and the beginning of that one."""
        lexer = shlex.shlex(os.environ.get("COMP_WORDS", ""), posix=True)
        lexer.whitespace_split, lexer.escape, lexer.commenters = True, "", ""
        words: list[str] = []
        with contextlib.suppress(ValueError):  # a quotation mark that is still open
            words.extend(lexer)
        begun = os.environ.get("COMP_CWORD", "").strip("'\"")
        if begun and words and words[-1] == begun:
            words.pop()
        return words[1:], begun

    def format_completion(self, item: CompletionItem) -> str:
        """Return the line of an answer."""
        return f"{item.value}\t{item.help or ''}"

    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        """Return the answers without those that stand for files."""
        return [item for item in super().get_completions(args, incomplete) if item.type == "plain"]


add_completion_class(PowerShellComplete)


def script(shell: str) -> str:
    """Return the script of a shell."""
    known = get_completion_class(shell)
    if known is None:
        raise AssertionError(f"no completion for {shell}")
    nothing: Any = click.Command(PROGRAM)  # only the words of the script are wanted
    shell_complete = known(nothing, {}, PROGRAM, VARIABLE)
    return shell_complete.source_template % shell_complete.source_vars()


@click.command(
    "completion",
    epilog=examples(
        'eval "$(gcode2krl completion bash)"',
        "gcode2krl completion bash >> ~/.bashrc",
        "gcode2krl completion zsh >> ~/.zshrc",
        "gcode2krl completion fish > ~/.config/fish/completions/gcode2krl.fish",
        "gcode2krl completion powershell >> gcode2krl.ps1",
    ),
)
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> None:
    """Print the script that completes commands, options and files in a shell.

    Append it to the file that the shell reads at its start: ~/.bashrc, ~/.zshrc, $PROFILE of PowerShell.
    """
    click.echo(script(shell).strip("\n"))

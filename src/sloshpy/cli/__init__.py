"""The command line: one subcommand per verb; it parses, calls and prints."""

import os
import sys
from collections.abc import Sequence

import cyclopts

from sloshpy.cli import cycles, decay, dispersion, flight, inputs, loop, review, time
from sloshpy.cli.app import app
from sloshpy.errors import InputError, OutsideValidity

__all__ = ["app", "cycles", "decay", "dispersion", "flight", "inputs", "loop", "main", "review", "time"]


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line, by default on the words it was called with.

    Faults of the input go to standard error, with exit status 2.
    """
    try:
        status = app(sys.argv[1:] if words is None else list(words), exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        command = " ".join(error.command_chain) if error.command_chain else ""
        print(f"error: {str(error).rstrip('.')}; see sloshpy {command} --help".replace("  ", " "), file=sys.stderr)
        status = 2
    except InputError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        status = 2
    except BrokenPipeError:  # the reader, `head` say, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except (OutsideValidity, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        status = 2
    sys.exit(status)

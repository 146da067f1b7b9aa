"""The whole review of a case."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.text import Text

from sloshpy.assess import Assessment, assess
from sloshpy.cli.app import app
from sloshpy.cli.options import Amplitude, CaseFile, Damping, read_at, refused, writable
from sloshpy.files import read_case


@app.command(name="assess")
def assess_command(
    case: CaseFile,
    *,
    json: Annotated[bool, Parameter(negative="", help="print one JSON object in SI units")] = False,
    report: Annotated[Path | None, Parameter(help="write a self-contained HTML report")] = None,
    figures: Annotated[Path | None, Parameter(help="write every figure into this folder")] = None,
    full: Annotated[
        bool,
        Parameter(negative="", help="into report and figures also exact orbits, degradation map, all danger zones"),
    ] = False,
    damping: Damping = None,
    amplitude: Amplitude = None,
) -> int:
    """Review a case: verdict with reasons, margins, danger zone, required damping, limit cycles.

    Exit status: 0 the criteria are met, 1 one is not (or no verdict is supported), 2 the input was refused.
    """
    read = read_case(case)
    if report is not None:
        writable(case, report, {".html", ".htm"})
    if figures is not None and figures.exists() and not figures.is_dir():
        raise refused("--figures", figures, "is a file", "name a folder")
    if full and report is None and figures is None:
        raise refused("--full", "", "needs --report or --figures", "name where it goes")
    review = assess(read, **read_at(read, damping, amplitude))
    if report is not None or figures is not None:
        from sloshpy.report import write_figures, write_report  # matplotlib: only when something is drawn

        if figures is not None:
            write_figures(review, figures, full=full)
        if report is not None:
            write_report(review, report, full)
    if json:
        print(review.to_json())
    else:
        _print_review(review)
    return 0 if review.verdict == "pass" else 1


def _print_review(review: Assessment) -> None:
    first, _, rest = str(review).partition("\n")
    style = {"pass": "bold green", "fail": "bold red"}.get(review.verdict, "bold yellow")
    Console(soft_wrap=True, highlight=False).print(Text(first, style=style))
    print(rest)

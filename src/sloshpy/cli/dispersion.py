"""Campaigns of an uncertain case."""

import json as json_text
import os
import secrets
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TimeRemainingColumn
from rich.text import Text

from sloshpy.cli.app import app
from sloshpy.cli.options import quantity, refused
from sloshpy.dispersion import (
    Campaign,
    Cluster,
    Dispersion,
    findings,
    read_campaign,
    rerun,
    run_campaign,
    write_campaign,
)
from sloshpy.dispersion.campaign import Watch, holds_campaign, lacking
from sloshpy.dispersion.columns import columns_of
from sloshpy.dispersion.dispersion import drawn
from sloshpy.dispersion.export import check_export
from sloshpy.dispersion.rows import Status
from sloshpy.dispersion.store import read_header
from sloshpy.files import read_dispersion


@app.command
def disperse(
    file: Annotated[Path, Parameter(help="dispersion file (TOML)")],
    *,
    cases: Annotated[int | None, Parameter(help="number of draws; a store that is there knows its own")] = None,
    seed: Annotated[int | None, Parameter(help="root of all draws; without it one is drawn and printed")] = None,
    store: Annotated[Path | None, Parameter(help="folder in which finished blocks are kept")] = None,
    resume: Annotated[bool, Parameter(negative="", help="compute what the store lacks")] = False,
    partial: Annotated[bool, Parameter(negative="", help="read a store that is not finished, as n of N")] = False,
    case: Annotated[int | None, Parameter(help="run one case again, by its number")] = None,
    workers: Annotated[int | None, Parameter(help="processes; default: the cores of this machine")] = None,
    cluster: Annotated[str | None, Parameter(help="scheduler of dask.distributed, such as tls://host:8786")] = None,
    tls_ca: Annotated[Path | None, Parameter(help="PEM file of its authority", env_var="SLOSHPY_TLS_CA")] = None,
    tls_cert: Annotated[Path | None, Parameter(help="PEM file of our certificate", env_var="SLOSHPY_TLS_CERT")] = None,
    tls_key: Annotated[Path | None, Parameter(help="PEM file of our key", env_var="SLOSHPY_TLS_KEY")] = None,
    case_limit: Annotated[
        str, Parameter(help="longest that one case takes; of a flight each time, or the simulation")
    ] = "60 s",
    export: Annotated[Path | None, Parameter(help="write every draw and answer as NetCDF, .nc, or Zarr, .zarr")] = None,
    figures: Annotated[
        Path | None, Parameter(help="of a flight: percentiles over time, a figure and a table of each, in this folder")
    ] = None,
    json: Annotated[bool, Parameter(negative="", help="print one JSON object in SI units")] = False,
) -> int:
    """Draw an uncertain case or flight N times; say what share meets the criteria, how surely, and what drives it.

    Exit status: 0 the criteria are met as the file asks, 1 they are not or so few cases cannot show it, 2 the input was
    refused, 130 interrupted.
    """
    limit = quantity("--case-limit", case_limit, "s")
    count = len(os.sched_getaffinity(0)) if workers is None else workers
    if cluster is not None and workers is not None:
        raise refused("--workers", workers, "stands beside --cluster, which has its own", "leave one of them out")
    machines = None if cluster is None else Cluster(address=cluster, ca=tls_ca, cert=tls_cert, key=tls_key)
    _check_options(limit, count, store, resume, partial, export, figures)
    read = read_dispersion(file)
    if figures is not None and not read.flight:
        raise refused("--figures", figures, "needs a flight: one case has no time", "leave it out")
    there = store is not None and holds_campaign(store)
    if there and store is not None:
        header = read_header(store)
        grows = resume and cases is not None and cases > header["cases"]
        cases = cases if grows else _agreed("--cases", cases, header["cases"])
        seed = _agreed("--seed", seed, header["seed"])
    if case is not None:
        return _one(read, case, seed, store if there else None, json)
    if cases is None:
        raise refused("--cases", "", "is missing", "write --cases 2000")
    if seed is None:
        seed = secrets.randbits(32)
        print(f"seed {seed}, drawn now", file=sys.stderr)
    if there and store is not None and not resume:
        campaign = read_campaign(read, store, partial)
    elif partial:
        raise refused("--partial", store, "is no store yet", "run the campaign first")
    else:
        try:
            with _progress() as watch:
                campaign = run_campaign(
                    read,
                    cases,
                    seed,
                    store=store,
                    resume=resume,
                    workers=count,
                    cluster=machines,
                    case_limit=limit,
                    watch=watch,
                )
        except KeyboardInterrupt:
            kept = "nothing is kept without --store" if store is None else "what is finished is kept; --resume goes on"
            print(f"interrupted: {kept}", file=sys.stderr)
            return 130
    return _told(campaign, export, figures, json)


def _check_options(
    limit: float,
    workers: int,
    store: Path | None,
    resume: bool,
    partial: bool,
    export: Path | None,
    figures: Path | None,
) -> None:
    """Refuse options that make no campaign, before anything is read."""
    if not 0.1 <= limit <= 1e5:
        raise refused("--case-limit", f"{limit:g} s", "must be 0.1 s to 1e5 s", 'write "60 s"')
    if not 1 <= workers <= 512:
        raise refused("--workers", workers, "must be 1 to 512", "leave it out for all cores")
    if store is None and (resume or partial):
        raise refused("--resume" if resume else "--partial", "", "needs --store", "name the folder of the campaign")
    if resume and partial:
        raise refused("--partial", "", "stands beside --resume", "finish the campaign or read it as it is")
    if export is not None:
        check_export(export)
    if figures is not None and figures.exists() and not figures.is_dir():
        raise refused("--figures", figures, "is a file", "name a folder")


def _told(campaign: Campaign, export: Path | None, figures: Path | None, json: bool) -> int:
    """Print what a campaign says, write what was asked for, and return the exit status."""
    found, aside = findings(campaign), sys.stderr if json else sys.stdout
    print(found.to_json() if json else found)
    if export is not None:
        write_campaign(campaign, export)
        print(f"table: {export}", file=aside)
    if figures is not None:
        from sloshpy.report import write_campaign_figures  # matplotlib: only when something is drawn

        for path in write_campaign_figures(campaign, figures):
            print(f"{'table' if path.suffix == '.csv' else 'figure'}: {path}", file=aside)
    return 0 if found.verdict == "pass" else 1


def _agreed(option: str, given: int | None, stored: int) -> int:
    if given is not None and given != stored:
        raise refused(option, given, f"is {stored} in the store", "leave it out or name another folder")
    return stored


def _one(read: Dispersion, case: int, seed: int | None, store: Path | None, json: bool) -> int:
    """Run one case again, print draws and answers, and hold them against the store."""
    if seed is None:
        raise refused("--seed", "", "is missing: a case is known by seed and number", "write the campaign's seed")
    if case < 0:
        raise refused("--case", case, "must be >= 0", "cases are numbered from 0")
    row, draws = rerun(read, seed, case), drawn(read, seed, case, 1)[0]
    same, missing = None, ""
    if store is not None:
        campaign, missing = read_campaign(read, store, partial=True), lacking(read, store, case)
        if not missing:
            same = bool(
                np.array_equal(campaign.values[case], row.values[0], equal_nan=True)
                and campaign.status[case] == row.status[0]
            )
    shown = [k for k, c in enumerate(columns_of(read)) if c.moment is None]
    columns, values = [columns_of(read)[k] for k in shown], row.values[0][shown]
    status = Status(int(row.status[0])).name.lower()
    if json:
        numbers = {c.name: float(v) if np.isfinite(v) else str(v) for c, v in zip(columns, values, strict=True)}
        inputs = dict(zip(read.inputs, map(float, draws), strict=True))
        told = {"case": case, "seed": str(seed), "draws": inputs, "answers": numbers}
        told |= {"status": status, "reason": row.reasons[0], "same": same}
        print(json_text.dumps(told | ({"not_compared": missing} if missing else {}), indent=1))
    else:
        print(f"case {case} of seed {seed}: {_fate(status, row.reasons[0])}")
        print("\n".join(f"  {name:32s} {x:.10g}" for name, x in zip(read.inputs, draws, strict=True)))
        print("\n".join(f"  {c.name:32s} {x:.10g} {c.unit}" for c, x in zip(columns, values, strict=True)))
        if same is not None:
            print("the same bits as in the store" if same else "NOT the same as in the store")
        if missing:
            print(f"NOT compared with the store: {missing}")
    return 1 if same is False or missing.endswith("damaged") else 0


def _fate(status: str, reason: str) -> str:
    """Return what became of a case; a reason that says it already stands alone."""
    return reason if reason.startswith(status) else f"{status} {reason}".rstrip()


class _Rate(ProgressColumn):
    """Cases a second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.0f}/s" if task.speed else "-/s")


@contextmanager
def _progress() -> Iterator[Watch]:
    """Show a bar with rate and time left on standard error; Ctrl-C and a polite kill end in the same way."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    columns = (BarColumn(), MofNCompleteColumn(), _Rate(), TimeRemainingColumn())
    try:
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            bar = progress.add_task("cases", total=None)
            yield lambda done, total: progress.update(bar, completed=done, total=total)
    finally:
        signal.signal(signal.SIGTERM, before)

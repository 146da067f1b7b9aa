"""A figure to a file: the suffix is the format, and the same figure gives the same bytes."""

import io
import os
from collections.abc import Sequence
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from sloshpy.files.write import write_whole

Drawn = Axes | Figure | Sequence[Axes]
RESOLUTION = 150  # dots per inch of a PNG
_NO_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None, "Format": None, "Type": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def figure_bytes(drawn: Drawn, suffix: str, salt: str = "sloshpy") -> bytes:
    """Return a figure as the bytes of a PNG, SVG or PDF file, without date or program.

    Args:
        drawn: what a plot function returned.
        suffix: "png", "svg" or "pdf".
        salt: makes the names inside an SVG differ from those of another figure on the same page.
    """
    if suffix not in _NO_METADATA:
        raise ValueError(f'figures are written as {", ".join(_NO_METADATA)}, not "{suffix}"')
    stream = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": salt}):
        _figure(drawn).savefig(stream, format=suffix, dpi=RESOLUTION, metadata=_NO_METADATA[suffix])
    return stream.getvalue()


def save_figure(drawn: Drawn, path: str | os.PathLike[str]) -> Path:
    """Write a figure to a PNG, SVG or PDF file, whole or not at all.

    Args:
        drawn: what a plot function returned: Axes, a pair of Axes, or their Figure.
        path: the file; its suffix says the format.

    Raises:
        ValueError: a suffix other than .png, .svg or .pdf.
        InputError: the file cannot be written.
    """
    target = Path(path)
    write_whole(target, figure_bytes(drawn, target.suffix.lower().removeprefix(".")))
    return target


def _figure(drawn: Drawn) -> Figure:
    one: Axes | Figure = drawn if isinstance(drawn, Axes | Figure) else drawn[0]
    found: FigureBase | None = one if isinstance(one, Figure) else one.get_figure(root=True)
    if not isinstance(found, Figure):
        raise ValueError("the Axes belong to no figure")
    return found

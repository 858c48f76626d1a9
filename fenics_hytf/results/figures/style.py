# SPDX-License-Identifier: MIT
"""How figures look: one restrained style, colours safe for the colour-blind, units that fit.

Colours are those of Okabe and Ito (2008), less yellow, which does not show on white.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fenics_hytf.motion.files import replacing

RealArray = npt.NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
INK = "#222222"
QUIET = "#8a8a8a"
DASHED = (0, (4, 2))
MAX_LINES = len(COLOURS)
"""Most receivers, regions or lapses that one figure tells apart."""

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=COLOURS),
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.3,
    "text.color": INK,
    "figure.dpi": 150,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the package's style; what the user has set elsewhere is left alone."""
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # names in any script
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def label(text: str, longest: int = 28) -> str:
    """A user's name as matplotlib shows it as it is: no mathematics, never hidden, not too long."""
    if len(text) > longest:
        text = text[: longest - 1] + "…"
    if text.startswith("_"):
        text = "\u200b" + text  # matplotlib hides labels that start with an underscore
    return text.replace("$", r"\$")


def legend(axes: Axes) -> None:
    """Name the lines of a figure on its right, outside; nothing where none has a name."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG.

    Args:
        figure: Made without pyplot, so that nothing keeps it and no display is asked for.
        path: The file.
    """
    with replacing(path) as part:
        part.write_bytes(png(figure))


def png(figure: Figure) -> bytes:
    """A figure as the content of a PNG file."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": "fenics_hytf"})
    return buffer.getvalue()


def length_unit(peak: float) -> tuple[float, str]:
    """The unit of length that suits a peak.

    Args:
        peak: Largest value [m].

    Returns:
        Units in a metre and the unit's name.
    """
    for limit, factor, unit in ((1.0, 1.0, "m"), (1e-2, 1e2, "cm"), (1e-5, 1e3, "mm")):
        if peak >= limit:
            return factor, unit
    return (1e3, "mm") if peak == 0.0 else (1e6, "µm")


def spread(count: int, most: int) -> list[int]:
    """Which of many to show: the first, the last, and others evenly between them.

    Args:
        count: How many there are.
        most: How many are shown at most.

    Returns:
        Their numbers from 0, ascending.
    """
    return [int(i) for i in np.linspace(0, count - 1, min(count, most)).round()]


def chosen(names: Sequence[str], heights: Sequence[float]) -> list[int]:
    """Which of many to draw: at most ``MAX_LINES``, spread evenly from the highest to the lowest.

    Args:
        names: Names of the receivers.
        heights: Their elevations [m].

    Returns:
        Indices into ``names``, highest first; equal heights keep their order.
    """
    order = sorted(range(len(names)), key=lambda i: -heights[i])
    if len(order) <= MAX_LINES:
        return order
    return [order[place] for place in spread(len(order), MAX_LINES)]

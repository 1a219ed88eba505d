"""The common look of all figures: sizes, colours that colour-blind readers can
distinguish, and a line style for each strategy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from elastocal.io.atomic_writes import write_atomically

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from matplotlib.axis import Axis
    from matplotlib.typing import RcKeyType

    from elastocal.io.origin import Origin

WIDTH_MM = 165
_MM_PER_INCH = 25.4
MICRO = 1e6
MILLI = 1e3
# The palette of Okabe and Ito, without black and without the yellow that is too pale for
# lines, and two further colours.
PALETTE = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#7F3C8D",
    "#4D4D4D",
)
# Label and colour of the errors of a campaign, before and after correction.
STAGES = {
    "before": ("before", PALETTE[1]),
    "after": ("with the effects found", PALETTE[0]),
}
DASHES = (
    "-",
    (0, (1, 2)),
    "--",
    (0, (4, 4)),
    "-",
    (0, (2, 3)),
    "-.",
    (0, (6, 1.5, 1, 1.5)),
)
SETTINGS: dict[RcKeyType, Any] = {
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.title_fontsize": 7.5,
    "pdf.fonttype": 42,
}


# Decorator for functions that draw a figure: legends and titles take the settings that
# are active when they are created.
styled = rc_context(SETTINGS)


def create_panels(
    rows: int,
    columns: int,
    height_mm: float,
    width_mm: float = WIDTH_MM,
    **options: Any,
) -> tuple[Figure, np.ndarray]:
    """Create a figure with a grid of axes in the common look.

    Parameters
    ----------
    rows, columns : int
        Shape of the grid.
    height_mm, width_mm : float
        Size of the figure.
    **options
        Passed on to ``Figure.subplots``.

    Returns
    -------
    figure : Figure
    axes : (rows, columns) array of Axes
    """
    size = (width_mm / _MM_PER_INCH, height_mm / _MM_PER_INCH)
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def add_legend_below(figure: Figure, columns: int, title: str | None = None) -> None:
    """Add one legend below all panels, with each label once."""
    handles_by_label = {}
    for axis in figure.axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles_by_label[label] = handle
    figure.legend(
        [*handles_by_label.values()],
        [*handles_by_label],
        title=title,
        loc="outside lower center",
        ncols=columns,
    )


def draw_note(text: str, height_mm: float = 25) -> Figure:
    """Draw a figure that says in words why there is nothing to draw."""
    figure, axes = create_panels(1, 1, height_mm)
    axes[0, 0].set_axis_off()
    axes[0, 0].text(0.5, 0.5, text, ha="center", va="center")
    return figure


def choose_line_style(index: int) -> dict[str, Any]:
    """Choose colour and dashes by a strategy's position in the list; coincident lines
    remain visible through the gaps."""
    return {
        "color": PALETTE[index % len(PALETTE)],
        "linestyle": DASHES[index % len(DASHES)],
    }


def label_decades(*axes: Axis) -> None:
    """Put plain numbers on logarithmic axes, also at 2 and 5 between the decades."""
    for axis in axes:
        axis.set_major_locator(LogLocator(subs=[1.0, 2.0, 5.0]))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def choose_ink(colour: tuple[float, ...]) -> str:
    """Choose black or white, whichever has the higher contrast on a colour [1].

    Parameters
    ----------
    colour
        Red, green and blue of sRGB, 0 to 1; further components are ignored.

    References
    ----------
    .. [1] World Wide Web Consortium, Web Content Accessibility Guidelines 2.2, "relative
       luminance" and "contrast ratio", 2023.
    """
    linear = [
        value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
        for value in colour[:3]
    ]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return "black" if (luminance + 0.05) ** 2 > 1.05 * 0.05 else "white"


@styled
def save(figure: Figure, pdf: str, png: str, origin: Origin | None = None) -> None:
    """Write a figure as PDF and PNG without dates, so that the same data give the same
    bytes.

    Each format gets its own layout, because the widths of letters differ by a few per
    cent and labels would be cut off.

    Parameters
    ----------
    figure
    pdf, png : str
        Paths; each file appears complete or not at all.
    origin
        Written to the metadata of both files: Subject and Keywords of the PDF,
        Description and Source of the PNG.
    """
    pdf_metadata: dict[str, str | None] = {"CreationDate": None}
    png_metadata: dict[str, str | None] = {"Software": None}
    if origin is not None:
        keywords = " ".join(map(str, vars(origin).values()))
        pdf_metadata |= {"Subject": origin.words, "Keywords": keywords}
        png_metadata |= {"Description": origin.words, "Source": origin.commit}
    with write_atomically(pdf) as partial:
        figure.savefig(partial, format="pdf", metadata=pdf_metadata)
    with write_atomically(png) as partial:
        figure.savefig(partial, format="png", dpi=150, metadata=png_metadata)


def save_all(figures: Mapping[str, Figure], folder: str) -> dict[str, str]:
    """Write figures into a folder; returns the path of each PDF by the figure's name."""
    for name, figure in figures.items():
        save(figure, f"{folder}/{name}.pdf", f"{folder}/{name}.png")
    return {name: f"{folder}/{name}.pdf" for name in figures}


@styled
def save_svg(figure: Figure, path: str) -> None:
    """Write a figure for a page of the site, without a date and with names that are the
    same in every run.

    Text stays text, which the reader's own sans serif draws. The file appears complete
    or not at all.
    """
    with (
        rc_context({"svg.hashsalt": "elastocal", "svg.fonttype": "none"}),
        write_atomically(path) as partial,
    ):
        figure.savefig(partial, format="svg", metadata={"Date": None})

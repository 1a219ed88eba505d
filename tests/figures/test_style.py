"""The common look of all figures: sizes, lines that stay apart, and files without dates that appear whole or not at all."""

from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from elastocal.figures.style import PALETTE, WIDTH_MM, ink_on, note, panels, save, save_svg, styled
from elastocal.io.origin import Origin

# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB.
DICHROMATS = {
    "without red cones": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "without green cones": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}
XYZ_OF_RGB = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])


def simulate_lab(colour, eye):
    """CIELAB of an sRGB colour as a dichromat sees it."""
    value = np.array(to_rgb(colour))
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    part = XYZ_OF_RGB @ np.clip(eye @ linear, 0, 1) / XYZ_OF_RGB.sum(axis=1)
    x, y, z = np.where(part > 216 / 24389, np.cbrt(part), (24389 / 27 * part + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def save_both(figure, folder, name="figure"):
    pdf, png = folder / f"{name}.pdf", folder / f"{name}.png"
    save(figure, pdf.as_posix(), png.as_posix())


def test_a_figure_has_its_size_in_millimetres_and_a_grid_of_axes_even_for_one():
    figure, axes = panels(1, 1, 50.8)
    np.testing.assert_allclose(figure.get_size_inches(), [WIDTH_MM / 25.4, 2.0])
    assert axes.shape == (1, 1)
    figure, axes = panels(2, 3, 60, width_mm=76.2, sharey=True)
    assert axes.shape == (2, 3) and figure.get_figwidth() == pytest.approx(3.0)
    axes[0, 0].set_ylim(0, 7)
    assert axes[1, 2].get_ylim() == (0, 7)


def test_the_look_holds_inside_a_figure_function_and_nowhere_else():
    outside = dict(mpl.rcParams)
    assert styled(lambda: (mpl.rcParams["font.size"], mpl.rcParams["axes.spines.top"]))() == (8, False)
    assert dict(mpl.rcParams) == outside


@pytest.mark.parametrize("eye", DICHROMATS.values(), ids=DICHROMATS)
def test_colour_blind_readers_see_eight_different_colours(eye):
    seen = [simulate_lab(colour, np.array(eye)) for colour in PALETTE]
    # A difference of 2.3 is just noticeable side by side (Mahy et al. 1994); lines of a plot need several times that.
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 10


def test_the_same_figure_gives_the_same_bytes_without_a_date_and_letters_of_an_svg_are_letters(tmp_path):
    for name in "ab":
        figure, axes = panels(1, 1, 30)
        axes[0, 0].plot([1, 2], [3, 4])
        axes[0, 0].set_xlabel("angle (°)")
        save_both(figure, tmp_path, name)
        save_svg(figure, str(tmp_path / f"{name}.svg"))
    for kind in ("pdf", "png", "svg"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert b"CreationDate" not in (tmp_path / "a.pdf").read_bytes()
    assert "Software" not in Image.open(tmp_path / "a.png").info
    assert "angle (°)" in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_a_figure_that_cannot_be_drawn_leaves_the_earlier_file_as_it_was(tmp_path):
    (tmp_path / "figure.pdf").write_text("earlier", encoding="utf-8")
    figure = Figure()
    figure.text(0.5, 0.5, r"$\unknowncommand$")
    with pytest.raises(ValueError):
        save_both(figure, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["figure.pdf"]
    assert (tmp_path / "figure.pdf").read_text(encoding="utf-8") == "earlier"


@pytest.mark.parametrize(("colour", "ink"), [((1, 1, 1), "black"), ((0, 0, 0), "white"), ((0.5, 0.5, 0.5), "black")])
def test_numbers_on_a_colour_have_the_ink_of_the_higher_contrast(colour, ink):
    assert ink_on((*colour, 1.0)) == ink


def test_a_figure_names_commit_configuration_and_seed_in_both_files(tmp_path):
    origin = Origin("c0ffee", "d16e57", 7)
    for name, given in (("named", origin), ("again", origin), ("unnamed", None)):
        save(note("Nothing."), str(tmp_path / f"{name}.pdf"), str(tmp_path / f"{name}.png"), given)
    words = "commit c0ffee, configuration SHA-256 d16e57, seed 7"
    assert Image.open(tmp_path / "named.png").text == {"Description": words, "Source": "c0ffee"}
    assert f"/Subject ({words})".encode() in (tmp_path / "named.pdf").read_bytes()
    assert b"/Keywords (c0ffee d16e57 7)" in (tmp_path / "named.pdf").read_bytes()
    assert b"c0ffee" not in (tmp_path / "unnamed.pdf").read_bytes() + (tmp_path / "unnamed.png").read_bytes()
    for kind in ("pdf", "png"):
        assert (tmp_path / f"named.{kind}").read_bytes() == (tmp_path / f"again.{kind}").read_bytes()

"""The common look of all figures: sizes, lines that stay apart, and files without dates
that appear whole or not at all."""

import numpy as np
import pytest
from PIL import Image

from elastocal.figures.style import WIDTH_MM, create_panels, draw_note, save, save_svg
from elastocal.io.origin import Origin


def save_both(figure, folder, name="figure"):
    pdf = folder / f"{name}.pdf"
    png = folder / f"{name}.png"
    save(figure, pdf.as_posix(), png.as_posix())


def test_a_figure_has_its_size_in_millimetres_and_a_grid_of_axes_even_for_one():
    figure, axes = create_panels(1, 1, 50.8)
    np.testing.assert_allclose(figure.get_size_inches(), [WIDTH_MM / 25.4, 2.0])
    assert axes.shape == (1, 1)
    figure, axes = create_panels(2, 3, 60, width_mm=76.2, sharey=True)
    assert axes.shape == (2, 3) and figure.get_figwidth() == pytest.approx(3.0)
    axes[0, 0].set_ylim(0, 7)
    assert axes[1, 2].get_ylim() == (0, 7)


def test_the_same_figure_gives_the_same_bytes_without_a_date_and_letters_of_an_svg_are_letters(
    tmp_path,
):
    for name in "ab":
        figure, axes = create_panels(1, 1, 30)
        axes[0, 0].plot([1, 2], [3, 4])
        axes[0, 0].set_xlabel("angle (°)")
        save_both(figure, tmp_path, name)
        save_svg(figure, str(tmp_path / f"{name}.svg"))
    for kind in ("pdf", "png", "svg"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (
            tmp_path / f"b.{kind}"
        ).read_bytes()
    assert b"CreationDate" not in (tmp_path / "a.pdf").read_bytes()
    assert "Software" not in Image.open(tmp_path / "a.png").info
    assert "angle (°)" in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_a_figure_names_commit_configuration_and_seed_in_both_files(tmp_path):
    origin = Origin("c0ffee", "d16e57", 7)
    for name, given in (("named", origin), ("again", origin), ("unnamed", None)):
        save(
            draw_note("Nothing."),
            str(tmp_path / f"{name}.pdf"),
            str(tmp_path / f"{name}.png"),
            given,
        )
    subject = "commit c0ffee, configuration SHA-256 d16e57, seed 7"
    assert Image.open(tmp_path / "named.png").text == {
        "Description": subject,
        "Source": "c0ffee",
    }
    assert f"/Subject ({subject})".encode() in (tmp_path / "named.pdf").read_bytes()
    assert b"/Keywords (c0ffee d16e57 7)" in (tmp_path / "named.pdf").read_bytes()
    assert (
        b"c0ffee"
        not in (tmp_path / "unnamed.pdf").read_bytes()
        + (tmp_path / "unnamed.png").read_bytes()
    )
    for kind in ("pdf", "png"):
        assert (tmp_path / f"named.{kind}").read_bytes() == (
            tmp_path / f"again.{kind}"
        ).read_bytes()

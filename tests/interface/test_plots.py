import matplotlib.pyplot as plt
import pytest

import elastocal as ec


def test_figures_of_the_report_have_their_names(result):
    assert list(result.plot.all()) == ["before_after", "arrows", "candidates"]


def test_errors_are_drawn_on_given_axes(result):
    figure, axes = plt.subplots(1, 2)
    assert result.plot.errors(axes[0], "max") is figure
    assert axes[0].get_title() == "maximum"
    assert len(axes[0].patches) == len(result.errors)
    assert not axes[1].patches


def test_hypotheses_are_drawn_on_given_axes(result):
    figure, axes = plt.subplots()
    assert result.plot.candidates(axes) is figure
    assert "oint 2" in axes.get_yticklabels()[0].get_text()


@pytest.mark.parametrize(
    ("view", "height"), [("from the side", "z (m)"), ("from above", "y (m)")]
)
def test_residuals_are_drawn_on_given_axes(result, view, height):
    figure, axes = plt.subplots(1, 2)
    assert result.plot.residuals(axes[1], view) is figure
    assert axes[1].get_title(loc="left") == view
    assert axes[1].get_ylabel() == height
    arrows = {artist.get_gid() for artist in axes[1].collections}
    assert {"before", "after"} <= arrows
    assert not axes[0].collections


def test_another_view_or_error_is_refused(result):
    with pytest.raises(ec.InputError, match="view: found 'below'"):
        result.plot.residuals(view="below")
    with pytest.raises(ec.InputError, match="metric: found 'median'"):
        result.plot.errors(metric="median")

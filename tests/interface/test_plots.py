import matplotlib.pyplot as plt


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

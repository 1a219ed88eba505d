"""The common look: what is saved."""

from matplotlib.layout_engine import ConstrainedLayoutEngine

from elastocal.figures.style import panels, save


def test_the_layout_is_worked_out_once_for_document_and_picture(tmp_path, monkeypatch):
    execute, places = ConstrainedLayoutEngine.execute, []

    def counted(engine, figure):
        execute(engine, figure)
        places.append(figure.axes[0].get_position().bounds)

    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", counted)
    figure, axes = panels(1, 2, 60)
    axes[0, 0].set(title="title", xlabel="x", ylabel="y")
    paths = [tmp_path / name for name in ("figure.pdf", "figure.png")]
    save(figure, *map(str, paths))
    assert len(set(places)) == 1 and figure.axes[0].get_position().bounds == places[0]
    assert all(path.stat().st_size for path in paths)

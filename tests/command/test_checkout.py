import pytest

from elastocal.command.checkout import checkout


def test_a_checkout_above_the_working_directory_is_found(tmp_path, monkeypatch):
    (tmp_path / "workflow").mkdir()
    (tmp_path / "Snakefile").write_text("")
    (tmp_path / "campaigns" / "cell7").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "campaigns" / "cell7")
    assert checkout() == tmp_path


def test_without_a_checkout_here_the_one_of_the_package_is_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (checkout() / "src" / "elastocal").is_dir()


@pytest.mark.parametrize("missing", ["Snakefile", "workflow"])
def test_half_a_checkout_is_none(tmp_path, monkeypatch, missing):
    (tmp_path / "Snakefile").write_text("")
    (tmp_path / "workflow").mkdir()
    path = tmp_path / missing
    path.rmdir() if path.is_dir() else path.unlink()
    monkeypatch.chdir(tmp_path)
    assert checkout() != tmp_path

from typer.testing import CliRunner

from elastocal.command.main import app


def test_what_can_be_imported_is_said_without_being_told_what_to_import():
    shown = CliRunner().invoke(app, ["import"]).output
    assert "URDF" in shown and "Denavit-Hartenberg" in shown

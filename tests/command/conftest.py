"""Commands as they are typed."""

import shutil
from functools import cache

import numpy as np
import pandas as pd
import pytest
import typer.testing
from analysed_robots import analysed
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from elastocal.application.calibrated import compute_nominal_poses
from elastocal.command.main import app
from elastocal.errors import InputError

# Angles from the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


# Typer's runner builds all subcommands anew for each command, which takes longer than
# many a command.
typer.testing._get_command = cache(typer.testing._get_command)


def run_command(*arguments):
    """Run a command; its arguments may be paths and numbers."""
    return CliRunner().invoke(app, [*map(str, arguments)])


@pytest.fixture(autouse=True)
def commands_draw_blank_figures(blank_figures):
    """A command's own test looks at its figures if it is marked ``drawn``."""


@pytest.fixture(scope="session")
def elastocal():
    return run_command


@pytest.fixture(scope="session")
def refusal():
    """The line in which a command refuses its input."""

    def refuse(*arguments):
        error = run_command(*arguments).exception
        assert isinstance(error, InputError), error
        assert len(str(error).splitlines()) == 1, error
        return str(error)

    return refuse


@pytest.fixture
def in_checkout(checkout, monkeypatch):
    """The checkout with a diagnosed campaign as the working directory."""
    monkeypatch.chdir(checkout)
    return checkout


@pytest.fixture
def copied_checkout(checkout, tmp_path, monkeypatch):
    """A copy of this checkout, which a test may change, as the working directory."""
    return _enter_copy(checkout, tmp_path, monkeypatch)


@pytest.fixture
def copied_regressed_checkout(regressed_checkout, tmp_path, monkeypatch):
    """The same of a campaign whose residuals a regression explains."""
    return _enter_copy(regressed_checkout, tmp_path, monkeypatch)


def _enter_copy(checkout, tmp_path, monkeypatch):
    shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    return tmp_path / "top"


@pytest.fixture
def angles():
    """Angles of eight neighbouring poses of the KUKA, in a bent posture."""
    middle = analysed("kuka").joint_limits.mean(axis=1) + BENT
    return middle + 0.2 * np.linspace(0, 1, 8)[:, None]


@pytest.fixture
def write_path(tmp_path):
    """Writes a file of wanted poses, where joint angles put the rigid robot."""

    def write(angles, **columns):
        position, rotation = compute_nominal_poses(analysed("kuka"), angles)
        rotation_vector = Rotation.from_matrix(rotation).as_rotvec()
        table = pd.DataFrame(
            np.column_stack([position, rotation_vector]),
            columns=["x", "y", "z", "rx", "ry", "rz"],
        )
        table.assign(**columns).to_csv(tmp_path / "path.csv", index=False)
        return tmp_path / "path.csv"

    return write


@pytest.fixture
def path(write_path, angles):
    return write_path(angles)


@pytest.fixture
def output(tmp_path):
    return tmp_path / "targets.csv"


@pytest.fixture
def correct_arguments(in_checkout, path, output):
    """Arguments of a correction of these poses."""
    return "correct", in_checkout / "made", path, "--output", output

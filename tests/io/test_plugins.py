"""An installed package offers effects, importers, controllers and regressions; an error
in it is one line that names the package."""

import json
import os
import subprocess
import sys
import textwrap
from types import SimpleNamespace

import pytest
from support import refused

from elastocal.io.plugins import (
    EFFECTS,
    list_plugin_names,
    list_plugin_versions,
    load_plugins,
)

PYPROJECT = """
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"

[project]
name = "workshop-plugins"
version = "1.2"

[tool.setuptools]
py-modules = ["workshop_plugins"]

[project.entry-points."elastocal.effects"]
hoses = "workshop_plugins:hoses"

[project.entry-points."elastocal.importers"]
workshop = "workshop_plugins:WORKSHOP"

[project.entry-points."elastocal.controllers"]
lines = "workshop_plugins:LINES"

[project.entry-points."elastocal.regressions"]
mean_residual = "workshop_plugins:MEAN_RESIDUAL"
"""
MODULE = '''
"""One plug-in of each kind."""

import numpy as np

from elastocal.campaigns.importers import Importer, PublicFile, PublicMeasurements
from elastocal.effects.protocol import effect, turning_joints
from elastocal.effects.sizes import Size
from elastocal.exchange.controllers import Controller
from elastocal.residual_model.regressions import Predictor, Regression


@effect("elastic", "resistance of hoses", Size("turn", 1e-4, "made up"), at=turning_joints)
def hoses(own, sites, joint):
    """Hoses that resist the turning of a joint: theta = k q^3."""
    cubic = own.parameters("turn", ["cubic"], "rad/rad^3", sites)
    yield own.of_joint(joint, cubic, lambda around: [around.joint_angles[:, joint] ** 3])


def read_workshop(path):
    """Six joint angles in degrees and a position in mm a row."""
    table = np.loadtxt(path)
    return PublicMeasurements(np.radians(table[:, :6]), {"SMR": 1e-3 * table[:, 6:]}, {})


FILE = PublicFile("owner/workshop", "c0ffee", "values.txt", "0" * 64, "values.txt", "MIT")
WORKSHOP = Importer({"values": FILE}, read_workshop, ("ur10",))


def write_lines(name, targets, notes):
    rows = targets.values.tolist()
    return [name, *(" ".join(f"{value:.6f}" for value in row) for row in rows)]


LINES = Controller("lines", "lines", ".lines", ("A", "B"), (), "[A-Z]+", "capitals", write_lines)


def fit_mean(inputs, residual, settings, seed):
    mean = residual.mean(axis=0)
    yield Predictor(lambda asked: np.tile(mean, (len(asked), 1)))


MEAN_RESIDUAL = Regression("mean residual", fit_mean)
'''
# Use one plug-in of each kind, as the commands do, and print the results.
PROGRAM = """
import json, sys
from pathlib import Path

import numpy as np

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.importers import find_importer
from elastocal.campaigns.reading import read_campaign, read_robot
from elastocal.effects.catalogue import candidates_on, list_bundled_effects, list_effects
from elastocal.exchange.controllers import find_axes, find_controller, build_targets
from elastocal.io.origin import list_versions
from elastocal.loop.loading import load_campaign
from elastocal.mechanics.sites import build_sites
from elastocal.residual_model.regressions import Inputs, list_regressions

config, folder = map(Path, sys.argv[1:])
robots = config / "robots"
candidates = candidates_on(build_sites(read_robot(robots / "ur10.yaml")))
source = find_importer("workshop", config, "a test")
rows = np.hstack([np.arange(72.0).reshape(12, 6), np.arange(36.0).reshape(12, 3)])
np.savetxt(folder / "values.txt", rows)
source.write_campaign([folder / "values.txt"], folder / "campaign", robots, "workshop")
measurements = read_campaign(
    read_campaign_folder(folder / "campaign", robots)
).measurements
document = folder / "campaign" / "campaign.yaml"
text = document.read_text(encoding="utf-8")
document.write_text(f"{text}remainder: mean_residual\\n", encoding="utf-8")
descriptions, _, _ = load_campaign(
    read_campaign_folder(folder / "campaign", robots)
)
controller = find_controller("lines")
turning = (False, False)
targets = build_targets(np.zeros((1, 2)), turning, find_axes(controller, turning, ""))
inputs = Inputs(np.zeros((2, 6)), np.zeros((2, 0)), np.zeros((2, 3, 6)))
regression = list_regressions()["mean_residual"]
(predictor,) = regression.fit(inputs, np.ones((2, 3)), ({},), 1)
print(json.dumps({
    "keys": [key for key in candidates if key.startswith("hoses")],
    "new effects": sorted(set(list_effects()) - set(list_bundled_effects())),
    "first position": measurements.position[0].tolist(),
    "remainder": descriptions["campaign"]["remainder"],
    "program": controller.program("GO", targets),
    "prediction": predictor.mean(inputs).tolist(),
    "version": list_versions(folder)["workshop-plugins"],
}))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder into which pip has installed the package."""
    project = tmp_path_factory.mktemp("project")
    (project / "pyproject.toml").write_text(PYPROJECT, encoding="utf-8")
    (project / "workshop_plugins.py").write_text(MODULE, encoding="utf-8")
    target = tmp_path_factory.mktemp("installed")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index"]
    command += ["--no-build-isolation", "--no-deps", "--target", str(target)]
    subprocess.run([*command, str(project)], check=True, capture_output=True)
    return target


def test_an_installed_package_adds_an_effect_an_importer_a_controller_and_a_regression(
    installed, config_folder, tmp_path
):
    finished = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(config_folder), str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
    )
    assert finished.returncode == 0, finished.stderr
    outcome = json.loads(finished.stdout)
    assert outcome == {
        "keys": [f"hoses@{joint}" for joint in range(1, 7)],
        "new effects": ["hoses"],
        "first position": [0.0, 0.001, 0.002],
        "remainder": "mean_residual",
        "program": "GO\n0.000000 0.000000\n",
        "prediction": [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
        "version": "1.2",
    }


@pytest.fixture
def offer(tmp_path, monkeypatch):
    """Offer one object of a module as an effect, by a package on the path."""

    def write_package(entry_point, module):
        package = tmp_path / "broken_package-0.3.dist-info"
        package.mkdir()
        metadata = "Metadata-Version: 2.1\nName: broken-package\nVersion: 0.3\n"
        (package / "METADATA").write_text(metadata, encoding="utf-8")
        entry_points = f"[{EFFECTS}]\n{entry_point}\n"
        (package / "entry_points.txt").write_text(entry_points, encoding="utf-8")
        (tmp_path / "broken_module.py").write_text(textwrap.dedent(module))
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "broken_module", raising=False)

    return write_package


# A module that offers an object with a name of its own.
NAMED = """
    from types import SimpleNamespace
    tides = SimpleNamespace(name="moon")
"""


@pytest.mark.parametrize(
    ("name", "module", "reason"),
    [
        ("tides", "import no_such_module", "no_such_module"),
        ("tides", "1 / 0", "ZeroDivisionError"),
        ("tides", "", "AttributeError"),
        ("tides", "tides = 3", "a int"),
        ("tides", NAMED, "own name, 'moon'"),
        ("payload", NAMED, "a name that is taken"),
    ],
)
def test_an_error_in_a_plug_in_is_one_line_that_names_the_package(
    offer, name, module, reason
):
    offer(f"{name} = broken_module:tides", module)
    assert list_plugin_names(EFFECTS) == [name]
    assert list_plugin_versions() == {"broken-package": "0.3"}
    with refused("package broken-package", f"{EFFECTS} {name}", reason):
        load_plugins(EFFECTS, SimpleNamespace, ("payload",))

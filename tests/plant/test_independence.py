"""The plant shares no code with the analysis, at run time too; what its sources may import is a contract of `make lint`."""

import pkgutil
import subprocess
import sys

import elastocal_proof.plant


def test_making_data_loads_no_module_of_the_analysis():
    names = [f"elastocal_proof.plant.{module.name}" for module in pkgutil.iter_modules(elastocal_proof.plant.__path__)]
    code = f"import sys, {', '.join(names)}; print(*sorted(n for n in sys.modules if n.startswith('elastocal')))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in loaded if not name.startswith("elastocal_proof.plant")} == {
        "elastocal",
        "elastocal.errors",
        "elastocal_proof",
    }

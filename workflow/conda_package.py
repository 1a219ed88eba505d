"""Build the conda package of recipe/recipe.yaml, install it in an empty environment, and
run the example of the README there.

Usage: python workflow/conda_package.py --channel NAME [--channel NAME]..., in an
environment with the dependency group `conda`; `make conda` calls it. Where no channel is
reached, `--channel stand-in --libraries PYTHON` checks recipe, solution and installation
all the same: its packages are empty and have the names and versions of what is installed
beside the interpreter PYTHON, whose libraries are used.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import io
import json
import os
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

import rattler
import rattler_build
import yaml

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ROOT / "recipe" / "recipe.yaml"
STAND_IN = "stand-in"
# Names that conda has for packages of the index.
NAMES_OF_INDEX = {
    "snakemake-minimal": "snakemake",
    "matplotlib-base": "matplotlib",
    "typst-py": "typst",
}
_LIST_LIBRARIES = """
import json, sys, sysconfig
from importlib import metadata
versions = {d.name.lower().replace("_", "-"): d.version for d in metadata.distributions()}
print(json.dumps({
    "versions": versions,
    "python": ".".join(map(str, sys.version_info[:3])),
    "home": sys.base_prefix,
    "folder": sysconfig.get_path("purelib"),
}))
"""


@dataclass(frozen=True)
class Libraries:
    """What is installed beside an interpreter.

    Attributes
    ----------
    versions : dict
        Version of each distribution.
    python : str
        Version of the interpreter.
    home, folder : str
        Its prefix, and its folder of packages.
    """

    versions: dict[str, str]
    python: str
    home: str
    folder: str


@dataclass(frozen=True)
class Content:
    """Text files and symbolic links of a package, by their names."""

    files: dict[str, str]
    links: dict[str, str]


def list_libraries(python: str) -> Libraries:
    """List what is installed beside an interpreter."""
    command = [python, "-c", _LIST_LIBRARIES]
    finished = subprocess.run(command, capture_output=True, text=True, check=True)
    return Libraries(**json.loads(finished.stdout))


def list_requirements() -> list[str]:
    """List the names of what the recipe needs."""
    requirements = yaml.safe_load(RECIPE.read_text("utf-8"))["requirements"]
    lines = [*requirements["host"], *requirements["run"]]
    return sorted({line.split()[0] for line in lines})


def write_stand_in_channel(folder: Path, libraries: Libraries) -> str:
    """Write a channel of packages without content but Python; return its address."""
    (folder / "noarch").mkdir(parents=True)
    (folder / "linux-64").mkdir()
    records = {}
    for name in list_requirements():
        version = libraries.versions.get(NAMES_OF_INDEX.get(name, name), "")
        content = Content({}, {})
        if name == "python":
            version = libraries.python
            content = make_python(libraries)
        record = {"name": name, "version": version, "build": "0", "build_number": 0}
        record |= {"depends": [], "subdir": "linux-64", "license": "MIT"}
        path = folder / "linux-64" / f"{name}-{version}-0.tar.bz2"
        write_package(path, record, content)
        packed = path.read_bytes()
        digest = hashlib.sha256(packed).hexdigest()
        records[path.name] = record | {"sha256": digest, "size": len(packed)}
    for subdir, packages in {"linux-64": records, "noarch": {}}.items():
        document = {"info": {"subdir": subdir}, "packages": packages}
        text = json.dumps(document | {"packages.conda": {}, "repodata_version": 1})
        (folder / subdir / "repodata.json").write_text(text, encoding="utf-8")
    return folder.as_uri()


def make_python(libraries: Libraries) -> Content:
    """Make the content of the package of Python: a virtual environment over the
    interpreter, with a path file that names the folder of its libraries."""
    minor = libraries.python.rpartition(".")[0]
    files = {
        "pyvenv.cfg": f"home = {libraries.home}/bin\n",
        f"lib/python{minor}/site-packages/libraries.pth": f"{libraries.folder}\n",
    }
    programs = ("bin/python", "bin/python3", f"bin/python{minor}")
    return Content(files, dict.fromkeys(programs, f"{libraries.home}/bin/python3"))


def write_package(path: Path, record: dict[str, object], content: Content) -> None:
    """Write a conda package of the older form, an archive with its description."""
    paths = [
        describe_path(name, text, "hardlink") for name, text in content.files.items()
    ]
    paths += [describe_path(name, "", "softlink") for name in content.links]
    names = (*content.files, *content.links)
    description = {
        "info/index.json": json.dumps(record),
        "info/files": "".join(f"{name}\n" for name in names),
        "info/paths.json": json.dumps({"paths": paths, "paths_version": 1}),
    }
    with tarfile.open(path, "w:bz2") as archive:
        for name, text in (description | content.files).items():
            member = tarfile.TarInfo(name)
            member.size = len(text.encode())
            archive.addfile(member, io.BytesIO(text.encode()))
        for name, target in content.links.items():
            member = tarfile.TarInfo(name)
            member.type = tarfile.SYMTYPE
            member.linkname = target
            archive.addfile(member)


def describe_path(name: str, text: str, kind: str) -> dict[str, object]:
    """Describe a file of a package as conda does."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    size = len(text.encode())
    path = {"_path": name, "path_type": kind, "sha256": digest}
    return path | {"size_in_bytes": size}


def build_package(channels: list[str], folder: Path) -> Path:
    """Build the package of the recipe; return its file."""
    recipe = rattler_build.Stage0Recipe.from_file(RECIPE)
    (variant,) = recipe.render(rattler_build.VariantConfig())
    tools = rattler_build.ToolConfiguration(test_strategy="skip")
    result = variant.run_build(tools, output_dir=folder, channels=channels)
    (package,) = result.packages
    return Path(package)


async def install_package(channels: list[str], prefix: Path) -> list[str]:
    """Install elastocal of some channels in an empty environment; return the names of
    all packages."""
    virtual = rattler.VirtualPackage.detect()
    records = await rattler.solve(channels, ["elastocal"], virtual_packages=virtual)
    await rattler.install(records, target_prefix=prefix)
    return sorted(str(record.name.normalized) for record in records)


def main() -> None:
    """Build, install, run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--channel", action="append", dest="channels", required=True)
    parser.add_argument("--libraries", default=".venv/bin/python")
    arguments = parser.parse_args()
    channels = arguments.channels
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if channels == [STAND_IN]:
            libraries = list_libraries(arguments.libraries)
            channels = [write_stand_in_channel(folder / "channel", libraries)]
        package = build_package(channels, folder / "built")
        print("built", package.name, flush=True)
        prefix = folder / "environment"
        built = (folder / "built").as_uri()
        names = asyncio.run(install_package([built, *channels], prefix))
        print("installed", *names, flush=True)
        environment = {"PATH": f"{prefix}/bin:{os.environ['PATH']}"}
        environment["OMP_NUM_THREADS"] = "1"
        for command in (
            [prefix / "bin" / "elastocal", "--help"],
            [prefix / "bin" / "python", ROOT / "workflow/examples/five_lines.py"],
        ):
            subprocess.run(command, cwd=ROOT, env=environment, check=True)


if __name__ == "__main__":
    main()

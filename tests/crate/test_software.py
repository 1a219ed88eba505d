"""The list of installed packages."""

from importlib.metadata import version

from elastocal.crate.software import installed_packages


def test_packages_stand_once_each_with_version_and_licence():
    found = installed_packages()
    names = [package.name for package in found]
    assert names == sorted(set(names))
    listed = {package.name: package for package in found}
    for name in ("numpy", "snakemake", "pyarrow", "elastocal"):
        assert listed[name].version == version(name)
    assert listed["elastocal"].licence == "MIT"
    assert all("\n" not in package.licence for package in found)
    assert listed["numpy"].url == f"pkg:pypi/numpy@{version('numpy')}"

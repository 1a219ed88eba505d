"""Pages of the programming interface: one for each subpackage, made of the docstrings of its modules."""

from __future__ import annotations

import pkgutil
from importlib import import_module

import elastocal

HEAD = """Programming interface
=====================

One page for each subpackage of ``elastocal``, made of the docstrings. None of them needs Snakemake or a configuration file:
``import elastocal.mechanics.kinematics`` and the like.

"""
FOUNDATIONS = "Modules that all subpackages share"
# Adapters to the terminal and to Snakemake: the commands have a page of their own.
NO_INTERFACE = ("command",)


def pages() -> dict[str, str]:
    """Text of each page by its name."""
    subpackages = [
        found.name for found in pkgutil.iter_modules(elastocal.__path__) if found.ispkg and found.name not in NO_INTERFACE
    ]
    alone = [found.name for found in pkgutil.iter_modules(elastocal.__path__) if not found.ispkg]
    found = {f"{name}.rst": _page(f"elastocal.{name}") for name in subpackages}
    found["foundations.rst"] = _titled(FOUNDATIONS) + "".join(map(_module, [f"elastocal.{name}" for name in alone]))
    lines = [f"- :doc:`elastocal.{name} <{name}>`: {_summary(f'elastocal.{name}')}\n" for name in subpackages]
    lines.append(f"- :doc:`{FOUNDATIONS} <foundations>`: {', '.join(alone)}.\n")
    contents = "".join(f"   {name.removesuffix('.rst')}\n" for name in found)
    return {"index.rst": f"{HEAD}{''.join(lines)}\n.. toctree::\n   :hidden:\n\n{contents}", **found}


def _summary(name: str) -> str:
    """The first paragraph of a docstring, in one line."""
    return " ".join((import_module(name).__doc__ or "").partition("\n\n")[0].split())


def _page(name: str) -> str:
    package = import_module(name)
    modules = sorted(found.name for found in pkgutil.walk_packages(package.__path__, f"{name}."))
    return _titled(name) + f".. automodule:: {name}\n\n" + "".join(map(_module, modules))


def _titled(title: str) -> str:
    return f"{title}\n{'=' * len(title)}\n\n"


def _module(name: str) -> str:
    return f"{name}\n{'-' * len(name)}\n\n.. automodule:: {name}\n\n"

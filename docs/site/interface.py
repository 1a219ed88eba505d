"""Pages of the programming interface: one for each room of the package, made of the docstrings of its modules."""

from __future__ import annotations

import pkgutil
from importlib import import_module

import elastocal

HEAD = """Programming interface
=====================

One page for each room of the package ``elastocal``, made of the docstrings. The science needs no Snakemake and no configuration
file: ``import elastocal.mechanics.kinematics`` and the like.

.. toctree::
   :maxdepth: 1

"""
# Adapters to the terminal and to Snakemake: the commands have a page of their own.
NO_INTERFACE = ("command",)


def pages() -> dict[str, str]:
    """Text of each page by its name."""
    rooms = [found.name for found in pkgutil.iter_modules(elastocal.__path__) if found.ispkg and found.name not in NO_INTERFACE]
    alone = [found.name for found in pkgutil.iter_modules(elastocal.__path__) if not found.ispkg]
    found = {f"{room}.rst": _page(f"elastocal.{room}") for room in rooms}
    found["foundations.rst"] = _titled("What all rooms share") + "".join(map(_module, [f"elastocal.{name}" for name in alone]))
    return {"index.rst": HEAD + "".join(f"   {name.removesuffix('.rst')}\n" for name in found), **found}


def _page(room: str) -> str:
    package = import_module(room)
    modules = sorted(found.name for found in pkgutil.walk_packages(package.__path__, f"{room}."))
    return _titled(room) + f".. automodule:: {room}\n\n" + "".join(map(_module, modules))


def _titled(title: str) -> str:
    return f"{title}\n{'=' * len(title)}\n\n"


def _module(name: str) -> str:
    return f"{name}\n{'-' * len(name)}\n\n.. automodule:: {name}\n\n"

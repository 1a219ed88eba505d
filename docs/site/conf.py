"""Configuration of Sphinx, which makes the site from the pages that assemble.py puts
together."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))


import elastocal

project = "elastocal"
copyright = "the elastocal developers"
release = elastocal.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "extensions",
]

sphinx_gallery_conf = {
    "examples_dirs": str(Path(__file__).resolve().parents[2] / "examples" / "python"),
    "gallery_dirs": "examples",
    # Every example runs; a failing one fails the build.
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "image_scrapers": ("extensions.scrape_figures",),
    "reset_modules": ("extensions.forget_plugins",),
    "capture_repr": ("_repr_html_", "__repr__"),
    "ignore_repr_types": r"matplotlib\.",
    "within_subsection_order": "extensions.ExampleOrder",
    "download_all_examples": False,
    # Times of one machine would change the pages with each build.
    "min_reported_time": 1e9,
    "write_computation_times": False,
}

myst_enable_extensions = ["dollarmath"]
# Links to headings, as the hosting site makes them too.
myst_heading_anchors = 3
# Blocks of the pages show shells, tables and files of several kinds.
highlight_language = "text"
# Names in docstrings stand between single backticks.
default_role = "code"

# Words of docstrings, such as the type of a parameter, that more than one class of the
# package has for a name.
suppress_warnings = ["ref.python"]

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "none"
# The contents of the page list what people want to do, not each function.
toc_object_entries = False
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = "elastocal"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
# A browser lets no page that is opened as a file read others: results of a search are
# titles.
html_show_search_summary = False
# The search finds names; an index of all of them took as long as the rest of the
# reference.
html_use_index = False
html_domain_indices = False
html_show_sphinx = False

"""Sphinx configuration: MyST pages, the furo theme, nothing from the net."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

from omnisim.core.version import __version__  # noqa: E402

project = "omnisim"
author = "the omnisim authors"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated_pages"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_ext"]
nitpicky = False
# Links from included READMEs lead to files of the checkout, which are no pages.
suppress_warnings = [
    "myst.xref_missing",
    "ref.python",  # attributes of the same name in several classes, in docstrings of both
]

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["figures.css"]
html_title = f"omnisim {release}"
html_copy_source = False
html_show_sourcelink = False

"""Sphinx configuration. The package must be installed, or be on the path; LAMMPS and MPI need not be there."""

from importlib.metadata import PackageNotFoundError, version

project = "faultgouge"
author = "The faultgouge developers"
project_copyright = author
try:
    release = version("faultgouge")
except PackageNotFoundError:
    release = ""

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "README.md"]
myst_enable_extensions = ["amsmath", "dollarmath", "deflist"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = "faultgouge"

autodoc_mock_imports = ["lammps", "mpi4py"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autoclass_content = "class"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

"""Sphinx configuration. The package must be installed, or be on the path, with its plugin: the gallery runs LAMMPS."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

from docutils import nodes

sys.path.insert(0, str(Path(__file__).parent))  # gallery

project = "faultgouge"
author = "The faultgouge developers"
project_copyright = author
try:
    release = metadata.version("faultgouge")
except metadata.PackageNotFoundError:
    release = ""

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",
    "sphinx_design",
]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext", ".ipynb": "myst-nb"}
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300  # seconds for one cell
nb_merge_streams = True
exclude_patterns = ["_build", "README.md"]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

smartquotes = False  # --json is no dash
html_theme = "furo"
html_title = "faultgouge"
html_static_path = ["_static"]
html_css_files = ["site.css"]
suppress_warnings = ["ref.python"]  # a bare type that two pages have

autosummary_generate = False
autodoc_mock_imports = ["lammps", "mpi4py"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

MATH_OR_LITERAL = re.compile(r":math:`[^`]*`|``[^`]*``|^( *)\.\. math::.*\n(?:(?:\1 +.*)?\n)*", re.MULTILINE)


def keep_bars(app, what, name, obj, options, lines):
    """Docstrings write |y^H x| for an absolute value, which reStructuredText takes for a substitution."""
    text, done, end = "\n".join(lines) + "\n", "", 0
    for match in MATH_OR_LITERAL.finditer(text):
        done += text[end : match.start()].replace("|", r"\|") + match[0]
        end = match.end()
    done += text[end:].replace("|", r"\|")
    lines[:] = done.split("\n")


ALIAS = "Alias for field number"


def leave_out_aliases(app, what, name, obj, skip, options):
    """Fields of a named tuple, which the Attributes of its docstring describe already."""
    return True if (getattr(obj, "__doc__", None) or "").startswith(ALIAS) else None


def keep_first_line(app, what, name, obj, options, lines):
    """Napoleon takes "TEXT: MORE" of a constant for a type and a text; behind an empty comment it does not."""
    if what in ("attribute", "data", "property") and lines and ":" in lines[0]:
        lines[:0] = ["..", ""]


NUMBER = re.compile(r"[-+.,()\d]+(e[-+]?\d+)?( (to|±) [-+.,()\d]+(e[-+]?\d+)?)?")


def keep_numbers_whole(app, doctree):
    """Browsers end a line at a hyphen: a cell with 5.11e-13 must not become two lines."""
    for cell in doctree.findall(nodes.entry):
        if NUMBER.fullmatch(cell.astext()):
            cell["classes"].append("number")


def add_address(app, docname, source):
    """The line that clones the sources, as soon as CITATION.cff has the address of the repository."""
    if docname == "install":
        citation = (Path(__file__).parents[1] / "CITATION.cff").read_text()
        address = re.search(r"^repository-code: *(\S+)", citation, re.MULTILINE)
        line = f"    git clone {address[1]} faultgouge\n    cd faultgouge" if address else ""
        source[0] = re.sub(r"<!-- git clone.*?-->", line, source[0])


def find_documented(app, pagename, templatename, context, doctree):
    """Links from sources to pages: viewcode has one module name for all objects of a file, and some are of another."""
    objects = app.env.get_domain("py").objects

    def to_object(link):
        _, page, name = link.groups()
        words = name.split(".")
        of_page = [each for each, entry in objects.items() if page.endswith(f"{entry.docname}.html")]
        ends = ["." + ".".join(words[k:]) for k in range(1, len(words))] if name not in of_page else []
        found = (each for end in ends for each in of_page if each.endswith(end))
        return link[0].replace(f"#{name}", f"#{next(found, name)}")

    if pagename.startswith("_modules/"):
        context["body"] = re.sub(r'(class="viewcode-back" href=")([^"#]+)#([^"]+)', to_object, context["body"])


def make_gallery(app):
    """The ten examples, run."""
    import gallery

    gallery.make(Path(__file__).parent / "auto_gallery")


def make_live_pages(app, exception):
    """The pages of `faultgouge view`: of a scene that ships with the package, and of three disks of the tutorial."""
    if exception is not None or app.builder.format != "html":
        return
    here = Path(__file__).parent
    sys.path.insert(0, str(here.parent))
    from docs.run_page import files

    paper = (here.parent / "scenes" / "paper.toml").read_text()
    with tempfile.TemporaryDirectory() as folder:
        for page, scene in (("live", paper), ("three", files(here / "tutorial.md")["three.toml"])):
            Path(folder, f"{page}.toml").write_text(scene)
            for words in (["ramp", f"{page}.toml", "-o", f"{page}.h5"], ["view", f"{page}.h5", "-o", f"{page}.html"]):
                command = [sys.executable, "-m", "faultgouge", *words]
                subprocess.run(command, cwd=folder, env=os.environ | {"OMP_NUM_THREADS": "1"}, check=True)
            shutil.copy(Path(folder, f"{page}.html"), app.outdir)


def setup(app):
    app.connect("builder-inited", make_gallery)
    app.connect("source-read", add_address)
    app.connect("build-finished", make_live_pages)
    app.connect("doctree-read", keep_numbers_whole)
    app.connect("html-page-context", find_documented)
    app.connect("autodoc-process-docstring", keep_first_line, priority=90)
    app.connect("autodoc-process-docstring", keep_bars, priority=100)
    app.connect("autodoc-skip-member", leave_out_aliases)

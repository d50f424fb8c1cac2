"""The documentation site: `sphinx-build -c docs . build/site`, from the root folder of the clone.

The pages are the Markdown files of the clone as they stand, so that links between them hold on the
site as on a code host.  Notebooks are executed.  The reference is made of the docstrings.
"""

import base64
import json
import os
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

import slipsweep

ROOT = Path(__file__).parents[1]

#: What pages link to; other results of benchmarks stand in the pages themselves.
MEASUREMENTS = [
    "benchmarks/README.md",
    "benchmarks/results/record_times.md",
    "benchmarks/results/records.md",
]

project = "slipsweep"
author = copyright = "The slipsweep developers"
release = version = slipsweep.__version__

extensions = [
    "myst_nb",  # Markdown and notebooks
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_design",  # cards of the first page and of the gallery
]
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**", *MEASUREMENTS]
exclude_patterns = [".*", "build", "src", "tests", "docs/_templates", "**.ipynb_checkpoints"]
templates_path = [
    str(ROOT / "docs" / "_templates")
]  # autosummary looks from the source folder, others from here
default_role = "literal"
nitpicky = True

# Markdown: headings have the anchors that code hosts give them; pictures stand in <img>, for their
# width
myst_heading_anchors = 6
myst_enable_extensions = ["html_image"]
# tables copied into a page have headings of their own level
suppress_warnings = ["myst.header"]

# Every notebook runs anew: one that raises stops the build.  No cache: its age would decide what is
# shown.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s for a cell: ends one that hangs
# The notebooks' kernels inherit it.  A calibration, of small matrices, takes 2.4 s of processor
# time with it.  Without it takes 30 s where other processes are at work: threads of linear algebra
# wait for each other in busy loops.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Signatures without types: the docstrings have them in words.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
python_maximum_signature_line_length = 88
autosummary_generate_overwrite = True
numpydoc_show_class_members = False  # the template of classes lists them
# The parts that the docstring of every public object has.  Not PR01: the options of waveforms, and
# the values of enumerations, are described as attributes.
numpydoc_validation_checks = {
    "GL08",
    "SS01",
    "SS03",
    "PR02",
    "PR03",
    "PR07",
    "RT01",
    "SA01",
    "EX01",
}
numpydoc_validation_exclude = {r"\.\w+\.\w+$"}  # methods and attributes

html_theme = "pydata_sphinx_theme"
html_title = "slipsweep"
html_extra_path = ["site/root"]  # index.html, which leads to the first page
html_show_sourcelink = False
html_sidebars: dict[str, list[str]] = {
    "docs/quickstart": [],
    "docs/site/gallery": [],
}  # pages of a section of their own
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": [],
}


def thumbnails(app: Sphinx) -> None:
    """Write the first picture of each notebook, as it is stored there, for the gallery."""
    folder = ROOT / "build" / "thumbnails"
    folder.mkdir(parents=True, exist_ok=True)
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        outputs = [output.get("data", {}) for cell in cells for output in cell.get("outputs", ())]
        picture = next(data["image/png"] for data in outputs if "image/png" in data)
        (folder / f"{path.stem}.png").write_bytes(base64.b64decode(picture))


def setup(app: Sphinx) -> None:
    """Sphinx calls this."""
    app.add_lexer("csv", TextLexer)  # Pygments has none
    app.connect("builder-inited", thumbnails)

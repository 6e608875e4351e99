"""Settings of the pages: `make docs` builds them, offline, and takes warnings for errors."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]

project = "fenicsmech"
author = copyright = "fenicsmech contributors"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build", "tables"]
html_theme = "furo"
html_title = f"fenicsmech {release}"
html_static_path = ["static"]
html_css_files = ["wide.css"]

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "none"
highlight_language = "none"  # formulas; code says that it is python
napoleon_google_docstring = True
napoleon_custom_sections = [("Attributes", "params_style")]  # a list, as that of arguments


def literal_formulas(app, what, name, obj, options, lines):
    """Docstrings are plain text: indented blocks after an empty line are formulas, and `|`, `*`, `_` are themselves."""
    found, formula, margin = [], False, 0
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if line.strip():
            if formula:
                formula = indent > margin
            elif found and not found[-1].strip() and indent > margin:
                formula = True
                found += [" " * margin + "::", ""]
            if not formula:
                margin = indent
                parts = re.split(r"(``.*?``)", line)
                line = "".join(part if part.startswith("``") else re.sub(r"([|*_])", r"\\\1", part) for part in parts)
        found.append(line)
    lines[:] = found


def setup(app):
    app.connect("autodoc-process-docstring", literal_formulas, priority=100)  # before napoleon

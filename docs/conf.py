"""Settings of the pages: `make docs` builds them, offline, and takes warnings for errors."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]

project = "fenicsmech"
author = "the fenicsmech developers"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build", "tables"]
html_theme = "furo"
html_title = f"fenicsmech {release}"
html_static_path: list[str] = []

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_class_signature = "separated"
napoleon_google_docstring = True
napoleon_use_ivar = True

"""How Sphinx builds the site from this folder: `make docs`."""

from typing import Any

from sphinx.application import Sphinx

from semrl import __version__

project = "semrl"
author = "the authors of semrl"
copyright = "the authors of semrl"  # noqa: A001 (Sphinx declares it so)
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"semrl {release}"
html_theme_options = {"navigation_with_keys": True}

# The same files are read on GitHub: links between them are plain Markdown, and so are links to headings.
myst_heading_anchors = 3
myst_links_external_new_tab = True

# Docstrings are numpydoc; `name` in single backticks links where it is documented.
default_role = "py:obj"
napoleon_google_docstring = False
napoleon_use_ivar = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autoclass_content = "class"


def _keep_colons(_app: Any, what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """Keep napoleon from taking what stands before a colon, in what is said of an attribute, for its type."""
    if what == "attribute":
        lines.insert(0, r"\ ")  # an escaped space, which is printed as nothing


def setup(app: Sphinx) -> None:
    """Connect what is ours; called by Sphinx."""
    app.connect("autodoc-process-docstring", _keep_colons, priority=400)  # before napoleon's 500

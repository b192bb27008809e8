"""Sphinx configuration. ``scripts/docs`` builds the site into build/docs, with warnings as errors."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

import sphinx.ext.autosummary as autosummary

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

project = "drake_shared"
author = "the drake_shared developers"
copyright = f"2026, {author}"
version = release = version_of("drake_shared")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "command_line",
    "docstrings",
    "fields",
    "public_names",
    "pydrake_system",
    "rooms",
]
exclude_patterns = ["_ext", "README.md"]
html_theme = "pydata_sphinx_theme"
html_title = "drake_shared"
html_sidebars = {
    page: [] for page in ("index", "tutorial", "concepts", "architecture", "results", "security")
}
html_static_path = ["_static"]
html_css_files = ["drake_shared.css"]
html_copy_source = False
html_theme_options = {
    "navigation_depth": 2,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
# Pages name files of the checkout, such as CONTRIBUTING.md, that are no pages of the site.
suppress_warnings = ["myst.xref_missing"]

# A summary is the first sentence of a docstring; these do not end it.
autosummary.WELL_KNOWN_ABBREVIATIONS += ("eq.", "Eq.", "Fig.", "Alg.", "sec.")
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # Signatures show them; docstrings give shapes and units.
autodoc_class_signature = "separated"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [
    ("Inputs", "params_style"),
    ("Outputs", "params_style"),
    ("State", "params_style"),
    ("Context parameters", "params_style"),
    ("Results", "params_style"),
]
default_role = "literal"

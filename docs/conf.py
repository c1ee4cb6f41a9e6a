"""Sphinx configuration of the documentation: `make docs` writes build/docs/index.html."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "modalwatch"
author = "The modalwatch authors"
copyright = "The modalwatch authors, Apache-2.0"  # noqa: A001 - a setting of Sphinx
version = release = installed_version("modalwatch")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
    "docs._site.mathml",
    "docs._site.docstrings",
    "docs._site.generated",
]
exclude_patterns = ["_site"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

highlight_language = "text"  # of blocks that name none

html_theme = "pydata_sphinx_theme"
html_title = "modalwatch"
html_static_path = ["_site/static"]
html_css_files = ["modalwatch.css"]
html_math_renderer = "mathml"  # of the browser: nothing is loaded from a network
html_show_sourcelink = html_copy_source = False
html_use_index = html_domain_indices = False  # the search has all names
smartquotes = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_persistent": [],
    "navbar_end": ["search-button", "theme-switcher"],
    "header_links_before_dropdown": 6,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}

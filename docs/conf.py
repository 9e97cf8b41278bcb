"""Configuration of the documentation: built offline, read offline."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import servotwin

project = "servotwin"
author = "The servotwin developers"
copyright = "the servotwin developers"
version = release = servotwin.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "mathml", "tables"]
exclude_patterns = ["_build", "_ext", "_static"]
nitpicky = False
suppress_warnings = ["ref.python"]  # a word such as `time` that names several attributes stays a word

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
html_math_renderer = "mathml"  # browsers draw MathML themselves: no script, no network

autosummary_generate = False  # the tables link to what stands on the same page
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
add_module_names = False
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_preprocess_types = True

html_theme = "pydata_sphinx_theme"
html_title = f"servotwin {release}"
html_static_path = ["_static"]
html_css_files = ["servotwin.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
}
html_sidebars = {"index": [], "getting-started": [], "validation": [], "glossary": [], "changelog": []}


def setup(app):
    """Leave out the fields of named tuples, of which Python says nothing but their number."""
    app.connect("autodoc-skip-member", lambda app, what, name, item, skip, options:
                True if (getattr(item, "__doc__", None) or "").startswith("Alias for field number") else None)

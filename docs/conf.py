"""The settings of the rendered documentation: `pip install ".[docs]"`, then
`sphinx-build -W docs build/site`.

The pages are plain Markdown, which a forge shows as they are.  What is more than Markdown is made
by the files in `site/`.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "site")]

project = "liemech"
language = "en"
extensions = [
    *("myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton"),
    *(
        "mathml",
        "contents",
        "docstrings",
        "reference",
        "examples",
        "flip",
        "breaks",
        "sources",
        "typeset",
        "contact_sheet",
    ),
]
exclude_patterns = ["figures/*.py", "derivations", "site", "generated/pages", "proof/measured"]
nitpicky = True
# Markdown
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 4
math_numfig = False
html_math_renderer = "mathml"

# the reference
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_typehints = "none"
autodoc_preserve_defaults = True
add_module_names = False
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"
viewcode_line_numbers = True

# the look
html_theme = "furo"
html_title = "liemech"
html_logo = html_favicon = "site/static/liemech.svg"
html_static_path = ["site/static"]
html_css_files = ["liemech.css"]
html_extra_path = ["generated/extra"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
pygments_style = "default"
pygments_dark_style = "native"
copybutton_exclude = ".linenos, .gp, .go"

(HERE / "generated" / "extra").mkdir(parents=True, exist_ok=True)

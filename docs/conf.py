"""The site of the documentation, built by `make docs`: Sphinx, furo and MyST."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import sphinx.ext.autodoc.mock  # noqa: E402
import sphinx.ext.autosummary  # noqa: E402

from lime_keras.version import __version__  # noqa: E402

# Annotations such as `tf.Tensor | None`, of packages that are mocked below.
_MOCK = sphinx.ext.autodoc.mock._MockObject
_MOCK.__or__ = _MOCK.__ror__ = lambda self, other: self

# Else the summary of a module ends behind them.
sphinx.ext.autosummary.WELL_KNOWN_ABBREVIATIONS += ("Eq.", "Eqs.")

project = "lime_keras"
version = release = __version__
copyright = "the lime_keras project, MIT licence"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "_extensions.breaks",
    "_extensions.docstrings",
    "_extensions.equations",
]
exclude_patterns = ["_build", "_extensions", "_templates"]
templates_path = ["_templates"]
language = "en_GB"
smartquotes = False

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# Else a default that is a path shows where the site was built.
autodoc_preserve_defaults = True
# What only an extra brings: pages of these modules are made without it.
autodoc_mock_imports = [
    "drjit",
    "h5py",
    "jax",
    "keras",
    "manifold3d",
    "matplotlib",
    "mitsuba",
    "onnx",
    "scipy",
    "skimage",
    "tensorboard",
    "tensorflow",
    "tf2onnx",
    "threadpoolctl",
    "trimesh",
]
napoleon_numpy_docstring = False
napoleon_use_rtype = False
# Else attributes of dataclasses are described twice.
napoleon_use_ivar = True
# A name between backticks is code, in docstrings as in Markdown.
default_role = "code"

html_theme = "furo"
html_title = "lime_keras"
html_copy_source = False
html_show_sphinx = False
html_math_renderer = "mathml"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1b6b4a", "color-brand-content": "#1b6b4a"},
    "dark_css_variables": {"color-brand-primary": "#7fd3ab", "color-brand-content": "#7fd3ab"},
}
html_static_path = ["_static"]
html_css_files = ["site.css"]
copybutton_prompt_text = r">>> |\.\.\. "
copybutton_prompt_is_regexp = True

"""How Sphinx builds the pages: `make -C ros_ws doc`, without a network."""

import importlib.util
import tomllib
from pathlib import Path

HERE = Path(__file__).parent

project = 'endoscope'
author = 'the endoscope developers'
copyright = author  # noqa: A001 - Sphinx wants this name
version = release = tomllib.loads((HERE.parent / 'pyproject.toml').read_text())['project'][
    'version'
]

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'numpydoc',
    'matplotlib.sphinxext.plot_directive',
]
smartquotes = False  # '--' begins an option
exclude_patterns = ['build']

myst_enable_extensions = ['attrs_inline']
myst_heading_anchors = 4

# Training is documented by what it is called with; the network itself is an extra.
autodoc_mock_imports = [name for name in ('torch',) if importlib.util.find_spec(name) is None]
autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
autodoc_class_signature = 'mixed'
numpydoc_show_class_members = False
numpydoc_attributes_as_param_list = True

plot_formats = [('svg', 100)]
plot_html_show_formats = False
plot_html_show_source_link = False
plot_rcparams = {'svg.hashsalt': 'endoscope'}

html_theme = 'furo'
html_title = f'endoscope {release}'
html_copy_source = False
html_show_sphinx = False

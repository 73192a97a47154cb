"""Common parts of the project's pages: layout, style, tables, plots that can be zoomed."""

from endoscope_pages.page import ASSETS, html_table, render_page
from endoscope_pages.plots import Curve, Plot, figure_html

__all__ = ['ASSETS', 'Curve', 'Plot', 'figure_html', 'html_table', 'render_page']

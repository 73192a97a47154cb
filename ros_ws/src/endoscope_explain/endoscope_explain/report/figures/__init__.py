"""The plots of the report, each a string of SVG."""

"""Command line, configuration and launch files of the endoscope."""

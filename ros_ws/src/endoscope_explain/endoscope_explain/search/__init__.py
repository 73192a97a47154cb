"""The search for what is missing: screen, fit, and compare with rigs of another form."""

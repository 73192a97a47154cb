"""The console in a real browser: what happens to the page, and what the motors do then."""

"""The console in a real browser: events on the page, and the response of the motors."""

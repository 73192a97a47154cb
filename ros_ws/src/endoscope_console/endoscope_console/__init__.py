"""The operator console in the browser: a server between the graph and its page."""

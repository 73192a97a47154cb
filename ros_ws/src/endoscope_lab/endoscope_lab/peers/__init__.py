"""Other people's ways to say what is missing, on the rigs that our own is judged by."""

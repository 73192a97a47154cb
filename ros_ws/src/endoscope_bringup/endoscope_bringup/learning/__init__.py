"""What identification takes from bags."""

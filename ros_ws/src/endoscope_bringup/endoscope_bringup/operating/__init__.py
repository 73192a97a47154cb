"""What a person does to a running graph from a terminal."""

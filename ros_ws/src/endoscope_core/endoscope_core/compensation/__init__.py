"""What a compensator decides: the law that is in force, and which commands go out by it."""

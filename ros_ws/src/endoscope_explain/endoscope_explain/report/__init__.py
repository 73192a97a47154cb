"""What a person and a program read of an explanation."""

"""What is said about a joint: names, rivals, and whether the explanation is adequate."""

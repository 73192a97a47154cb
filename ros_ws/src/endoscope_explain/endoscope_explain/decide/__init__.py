"""What is concluded of a joint: names, rivals, and whether the explanation is adequate."""

"""Files that were damaged or crafted, and what the readers of this project do with them."""

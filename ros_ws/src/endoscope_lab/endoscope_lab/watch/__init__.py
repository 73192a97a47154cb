"""Change detection: rigs that change while a watch monitors them."""

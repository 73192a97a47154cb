"""The networks that the first paper compares (Table 3), trained by its recipe."""

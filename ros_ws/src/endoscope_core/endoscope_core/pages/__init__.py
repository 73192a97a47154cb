"""What every page of the project is made with: one look, and plots that can be zoomed."""

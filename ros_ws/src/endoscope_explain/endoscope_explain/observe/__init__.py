"""What is compared: readings on the analysis grid, their noise, and what a plant predicts."""

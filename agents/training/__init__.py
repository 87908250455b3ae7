"""What every training needs: a run folder, Ctrl-C, several seeds, Ray."""

"""What every training needs: a run folder, the loop of epochs, a command's exit, signals, several seeds, Ray."""

"""What every training needs: a run folder, the loop of epochs, a command's exit, Ctrl-C, several seeds, Ray."""

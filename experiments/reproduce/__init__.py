"""`make reproduce` and `make ablations`: trainings and measurements as stages in one workspace."""

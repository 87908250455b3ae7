"""`make reproduce` and `make ablations`: trainings and measurements as stages of one job."""

"""The command `python -m experiments.sumo_predictor`; the work is in `experiments/models/sumo_predictor.py`."""

from experiments.models.sumo_predictor import main

if __name__ == "__main__":
    main()

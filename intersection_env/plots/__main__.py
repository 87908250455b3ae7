"""The command `python -m intersection_env.plots`."""

import sys

from intersection_env.plots.map_plot import main

if __name__ == "__main__":
    sys.exit(main())

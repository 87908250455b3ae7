"""The command `python -m intersection_env.map_compiler`; the work is in `intersection_env/maps/compiler.py`."""

import sys

from intersection_env.maps.compiler import main

if __name__ == "__main__":
    sys.exit(main())

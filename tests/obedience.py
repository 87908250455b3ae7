"""The command `python -m tests.obedience`; the work is in `tests/hardening/obedience.py`."""

import sys

from tests.hardening.obedience import main

if __name__ == "__main__":
    sys.exit(main())

"""The command `python -m data.sumo`."""

from data.sumo.generate import main

if __name__ == "__main__":
    main()

"""The viewer in the browser: `python -m intersection_env view`."""

"""Refuses, in a sentence, a checkout whose core is not compiled; importing it is the check."""

import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).resolve().parent


def _what_to_do() -> str:
    """What is wrong with the package in this folder, and how to mend it."""
    folders = (Path(entry or ".").resolve() / HERE.name for entry in sys.path)
    compiled = (one for one in folders if any((one / f"_core{suffix}").exists() for suffix in EXTENSION_SUFFIXES))
    hidden = next((one for one in compiled if one != HERE), None)
    if hidden is None:
        return f"the package in {HERE} is a checkout's, and its core is not compiled: pip install -e {HERE.parent}"
    return (
        f"the checkout's folder {HERE}, whose core is not compiled, hides the package installed in {hidden}:"
        f" start Python in another folder, or install the checkout itself by pip install -e {HERE.parent}"
    )


if find_spec("intersection_env._core") is None:
    raise ImportError(_what_to_do())

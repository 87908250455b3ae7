"""Peers in processes of their own: libsumo crashes now and then, and others leave their mark on a process.

One that is not installed or fails is reported so, and whoever asked for it goes on.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

MOST_SECONDS = 180  # of a peer
NOT_INSTALLED = 3  # exit status


def in_own_process(module: str, name: str) -> dict[str, Any]:
    """What `python -m MODULE NAME` prints last, as JSON; or why it is `missing`."""
    command = [sys.executable, "-W", "ignore", "-m", module, name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return {"missing": f"not done after {MOST_SECONDS} s"}
    if done.returncode == NOT_INSTALLED:
        return {"missing": "not installed"}
    if done.returncode:
        return {"missing": f"failed with exit status {done.returncode}"}
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def print_row(work: Callable[[], dict[str, Any]]) -> int:
    """Such a process's work: prints what it finds as JSON; returns the exit status."""
    try:
        row = work()
    except ModuleNotFoundError as error:
        print(error, file=sys.stderr)
        return NOT_INSTALLED
    print(json.dumps(row))
    return 0

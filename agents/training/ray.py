"""Ray: connected to where it runs, or started here.

It is connected to where the environment variable RAY_ADDRESS says, else to a cluster that was started on this machine
by `ray start`, else it is started here and ends with the training. All machines need this checkout, installed with
`pip install -e '.[train,ray]'`, and the files of the training under the same paths. A cluster that asks for a token
(Ray's default) is joined with RAY_AUTH_MODE=token, Ray's own variable.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

LOCAL_RAY: dict[str, Any] = {"include_dashboard": False, "logging_level": "ERROR"}


@contextmanager
def ray_for(option: str) -> Iterator[Any]:
    """The module `ray`, connected to or started; left on exit, if it was not connected to before.

    Raises:
        ValueError: it is not installed; the message names the option that needs it.
    """
    try:
        import ray
    except ImportError as error:
        raise ValueError(f"{option} needs Ray, which is not installed: pip install -e '.[ray]'") from error
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init(**LOCAL_RAY)
    try:
        yield ray
    finally:
        if is_ours:
            ray.shutdown()

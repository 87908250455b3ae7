"""Runs every example that learns with another library, shortly, in an environment of its own.

python -m tests.clients            all of them (`make clients`)
python -m tests.clients sb3_ppo    some

Each gets the wheel and what the file itself asks for, in the newest versions that pip finds; torch alone is pinned, as
in constraints.txt. Environments stay in out/clients; remove one to try newer versions.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.support.paths import ROOT

EXAMPLES = ROOT / "examples" / "learning"
ENVIRONMENTS = ROOT / "out" / "clients"
SHORTLY: Mapping[str, tuple[str, ...]] = {
    "minari_cloning": ("--passes", "1"),
    "rllib_multi_agent_ppo": ("--iterations", "1"),
    "rllib_ppo": ("--iterations", "1"),
    "sb3_ppo": ("--steps", "8192"),
    "single_file_ppo": ("--iterations", "2"),
    "tianshou_ppo": ("--epochs", "1"),
    "torchrl_ppo": ("--iterations", "2"),
}
"""The arguments with which each example is over soon."""
BEFORE: Mapping[str, tuple[str, ...]] = {
    "minari_cloning": ("-m", "data.minari", "--name", "intersection_env/bendplatz/train-v0"),
}
"""What is to be run from the checkout first."""
QUIETLY = {"PYTHONWARNINGS": "ignore", "OMP_NUM_THREADS": "1"}
TOO_SLOW = "timed out during startup"
"""What Ray says on a machine that is busy, where it gives itself half a minute: then it is tried once more."""
HEADER = re.compile(r"^# /// script\n(.*?)^# ///$", re.MULTILINE | re.DOTALL)
RETURN = re.compile(r"return +(-?[\d.]+|nan)")


def dependencies(name: str) -> list[str]:
    """What an example asks for beside this package, as its header says (PEP 723)."""
    header = HEADER.search((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))
    assert header is not None, f"{name}.py has no header that says what it needs"
    told = tomllib.loads(re.sub(r"^# ?", "", header[1], flags=re.MULTILINE))
    return [one for one in told["dependencies"] if one != "intersection_env"]


def run(*command: str | Path, folder: Path, environment: Mapping[str, str] = {}) -> str:
    """What a command prints, errors included.

    Raises:
        ChildProcessError: it failed; the message ends with what it printed.
    """
    done = subprocess.run(
        command, cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=os.environ | environment
    )
    if done.returncode:
        raise ChildProcessError(f"{' '.join(map(str, command))}: status {done.returncode}\n{done.stdout[-4000:]}")
    return done.stdout


def wheel(folder: Path) -> Path:
    """This package, built into a folder."""
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    run(*pip, "--wheel-dir", folder, ".", folder=ROOT)
    (found,) = folder.glob("*.whl")
    return found


def prepared(name: str, package: Path) -> Path:
    """The Python of an example's environment, which is made if it is not there; the package in it is always new.

    Examples that ask for the same share one.
    """
    home = ENVIRONMENTS / re.sub(r"\W+", "-", "-".join(dependencies(name)))
    python = home / "bin" / "python"
    if not python.exists():
        run(sys.executable, "-m", "venv", home, folder=ROOT)
    torch = home / "torch.txt"
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    torch.write_text("\n".join(line for line in lines if line.startswith("torch==")), encoding="utf-8")
    pip = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", torch)
    run(*pip, package, *dependencies(name), folder=ROOT)
    run(*pip, "--no-deps", "--force-reinstall", package, folder=ROOT)
    return python


def tried(name: str, package: Path) -> str:
    """The last line that an example prints.

    Raises:
        ChildProcessError: pip or the example failed.
        ValueError: it printed no return, or one that is no number.
    """
    python = prepared(name, package)
    with tempfile.TemporaryDirectory() as folder:
        own = {"MINARI_DATASETS_PATH": folder} | QUIETLY
        if name in BEFORE:
            # The package of the checkout, with the library of the example's environment.
            (site,) = (python.parents[1] / "lib").glob("python*/site-packages")
            code = f"import site, runpy, sys; site.addsitedir({str(site)!r}); sys.argv = {list(BEFORE[name][1:])!r}"
            run(sys.executable, "-c", f"{code}; runpy.run_module(sys.argv[0], run_name='__main__')",
                folder=ROOT, environment=own)  # fmt: skip
        command: tuple[str | Path, ...] = (python, EXAMPLES / f"{name}.py", *SHORTLY[name])
        try:
            printed = run(*command, folder=Path(folder), environment=own)
        except ChildProcessError as error:
            if TOO_SLOW not in str(error):
                raise
            print(f"{name}: Ray {TOO_SLOW}; once more", flush=True)
            printed = run(*command, folder=Path(folder), environment=own)
    returns = RETURN.findall(printed)
    if not returns or "nan" in returns:
        raise ValueError(f"{name} printed no return, or one that is no number:\n{printed[-4000:]}")
    return printed.strip().splitlines()[-1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the examples; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.clients", description=main.__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(SHORTLY)}; default: all")
    names = parser.parse_args(arguments).names or list(SHORTLY)
    if unknown := [name for name in names if name not in SHORTLY]:
        parser.error(f"there is no example {unknown[0]}; wanted {', '.join(SHORTLY)}")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        package = wheel(Path(folder))
        for name in names:
            begin = time.monotonic()
            try:
                came = tried(name, package)
            except (ChildProcessError, ValueError) as error:
                failed += 1
                came = f"FAILED: {error}"
            print(f"{name} ({time.monotonic() - begin:.0f} s): {came}", flush=True)
    print(f"{len(names) - failed} passed, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

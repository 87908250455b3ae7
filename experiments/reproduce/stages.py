"""Stages of long work: each is done once, in a process or here, and not again when the work is started anew."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from tqdm import tqdm

from agents.training.folder import METRICS, file_hash, last_row
from agents.training.interrupt import SIGNALED
from intersection_env.files import written_whole

WATCH_EVERY = 1.0  # [s]
LAST_LINES = 15  # of what a training said, when it fails


class StageFailedError(Exception):
    """A stage ended with an error, which it has printed; `status` is its exit status."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


def exit_status_of(work: Callable[[], None]) -> int:
    """Does work of many stages; says what ended it, if it did not come to its end."""
    try:
        work()
    except KeyboardInterrupt as interrupt:
        print("\ninterrupted; the same command goes on from here", file=sys.stderr)
        return SIGNALED + int(interrupt.args[0] if interrupt.args else signal.SIGINT)
    except StageFailedError as failure:
        print(f"error: {failure}", file=sys.stderr)
        return failure.status
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


@dataclass(frozen=True)
class Stages:
    """The stages of one work, and the folder where each says that it is done."""

    work: Path

    def run(self, name: str, inputs: Mapping[str, Any], output: Path, work: Callable[[], None]) -> str:
        """Does a stage's work, unless it was done with the same inputs and its output is still as it was.

        Args:
            name: of the stage.
            inputs: what its result depends on, as JSON holds it; of earlier stages what `run` returned for them.
            output: the file that it writes last.
            work: does it; what it raises ends all of it.

        Returns:
            A hash of its name and inputs.
        """
        key = hashlib.sha256(json.dumps([name, inputs], sort_keys=True).encode()).hexdigest()
        mark = self._mark(name)
        done = self._done(name)
        # another run, or a measurement by itself, may have written its own under the same name
        if done.get("key") == key and output.exists() and done.get("output") == file_hash(output):
            print(f"[{name}] was done before", flush=True)
            return key
        print(f"[{name}]", flush=True)
        mark.unlink(missing_ok=True)
        earlier = float(done["seconds"]) if done.get("begun") == key else 0.0
        begin, begun = time.perf_counter(), {"begun": key}
        try:
            work()
            begun = {"key": key, "output": file_hash(output)}
        finally:
            with written_whole(mark) as temporary:
                seconds = round(earlier + time.perf_counter() - begin, 1)
                temporary.write_text(json.dumps({**begun, "seconds": seconds}) + "\n", encoding="utf-8")
        return key

    def seconds(self, names: Sequence[str]) -> dict[str, float]:
        """What each stage took [s], tries that were interrupted included, but for those that were killed."""
        return {name: float(self._done(name)["seconds"]) for name in names}

    def _mark(self, name: str) -> Path:
        return self.work / "done" / f"{name}.json"

    def _done(self, name: str) -> dict[str, Any]:
        mark = self._mark(name)
        done: dict[str, Any] = json.loads(mark.read_text(encoding="utf-8")) if mark.exists() else {}
        return done


def run_module(*arguments: str) -> None:
    """Runs `python -m ARGUMENTS` as a process of its own, which prints here; signals are passed on to it as Ctrl-C.

    Raises:
        StageFailedError: it ended with an error.
    """
    with _told_to_end_like_ctrl_c():
        process = _started(arguments)
        try:
            status = process.wait()
        finally:
            _end([process])
    if status:
        raise StageFailedError(f"python -m {' '.join(arguments)} ended with exit status {status}", status)


def run_trainings(trainings: Mapping[Path, Sequence[str]], epochs: int, at_once: int) -> None:
    """Runs trainings side by side, with a bar each; what they print goes to `log.txt` in their run folders.

    Ctrl-C ends each at its next whole epoch, with its checkpoint written, and so do SIGTERM and a terminal that is
    closed; a second one ends all at once.

    Args:
        trainings: run folder to the arguments of `python -m`.
        epochs: that each lasts.
        at_once: most processes at a time.

    Raises:
        StageFailedError: one ended with an error; the others are ended at their next whole epoch.
    """
    waiting, running = list(trainings), dict[Path, subprocess.Popen[bytes]]()
    with ExitStack() as after:
        after.enter_context(_told_to_end_like_ctrl_c())
        bars = {
            run: after.enter_context(tqdm(total=epochs, desc=run.name, position=place, disable=None, unit="epoch"))
            for place, run in enumerate(trainings)
        }
        try:
            while waiting or running:
                while waiting and len(running) < at_once:
                    run = waiting.pop(0)
                    run.mkdir(parents=True, exist_ok=True)
                    log = after.enter_context((run / "log.txt").open("ab"))
                    running[run] = _started(trainings[run], log)
                time.sleep(WATCH_EVERY)
                for run, process in list(running.items()):
                    bars[run].n = last_row(run / METRICS).get("epoch", 0)
                    bars[run].refresh()
                    if process.poll() is not None:
                        del running[run]
                        _check(run, process.returncode)
        finally:
            _end(list(running.values()))


def _started(arguments: Sequence[str], log: BinaryIO | None = None) -> subprocess.Popen[bytes]:
    """`python -m ARGUMENTS` in a session of its own: Ctrl-C comes here alone, and is passed on by `_end`, once."""
    return subprocess.Popen([sys.executable, "-m", *arguments], stdout=log, stderr=log, start_new_session=True)


@contextmanager
def _told_to_end_like_ctrl_c() -> Iterator[None]:
    """Within it, SIGTERM and SIGHUP end this process as Ctrl-C does; its children would outlive it otherwise.

    The KeyboardInterrupt then holds the number of the signal.
    """

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt(number)

    signals = [one for one in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(one) is signal.SIG_DFL]  # no nohup
    for one in signals:
        signal.signal(one, end)
    try:
        yield
    finally:
        for one in signals:
            signal.signal(one, signal.SIG_DFL)


def _end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Ends those still running, trainings at their next whole epoch; at once, if Ctrl-C comes meanwhile."""
    for process in processes:
        process.send_signal(signal.SIGINT)
    try:
        for process in processes:
            process.wait()
    except KeyboardInterrupt:
        for process in processes:
            process.kill()
            process.wait()
        raise


def _check(run: Path, status: int) -> None:
    if status:
        said = (run / "log.txt").read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
        raise StageFailedError("\n".join([*said, f"the training in {run} ended with exit status {status}"]), status)

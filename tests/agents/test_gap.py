"""The gap network: its samples, its training, and that nothing of a run is lost."""

from __future__ import annotations

import dataclasses
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from agents.gap.samples import UNKNOWN, GapSamples, gap_samples
from agents.gap.train import GapSettings, train_network
from agents.networks.export import gap_network, policy_file, save_onnx
from agents.networks.gap import GapNetwork
from agents.training.folder import CHECKPOINT, METRICS, RunFolder, decisive, state_hash
from data.build import build
from intersection_env import Intersection, Predictor, Scenes, _core
from intersection_env.policies.file import PolicyFile
from tests.reference import predictor as reference
from tests.support.gap_fixture import hand_made, planted_samples
from tests.support.paths import RECORDINGS, ROOT
from tests.support.twins import twin_map

torch.set_num_threads(1)  # such small networks gain nothing from more
QUICK = GapSettings(epochs=120, batch=512, noise=0.0, calibrate=False)


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return build(RECORDINGS, Intersection.load("bendplatz"), ["12"], progress=False)


@pytest.fixture(scope="module")
def samples(scenes: Scenes) -> GapSamples:
    return gap_samples(scenes, progress=False)[0]


def twin_traffic(scenes: Scenes, frame: str) -> tuple[reference.Traffic, tuple[str, ...], str]:
    scene, seconds, yielder = frame.split(" ")
    traffic = scenes.at(scene, float(seconds))
    floats = (
        getattr(traffic, name).astype(np.float64) for name in ("position", "speed", "length", "width", "max_speed")
    )
    return reference.Traffic(traffic.route.astype(np.int64), *floats), traffic.ids, yielder


def test_features_equal_the_twin(scenes: Scenes, samples: GapSamples) -> None:
    for number in np.random.default_rng(0).choice(len(samples), 60, replace=False):
        twin, ids, yielder = twin_traffic(scenes, str(samples.frame[number]))
        pairs = reference.conflicts(twin_map("bendplatz"), twin)
        truth = reference.observe(twin_map("bendplatz"), twin).gap[pairs[:, 0] == ids.index(yielder)]
        np.testing.assert_allclose(samples.features[samples.sample == number], truth, atol=2e-3)


def test_labels_say_who_reached_the_conflict_first(scenes: Scenes, samples: GapSamples) -> None:
    """By brute force: walk on from the frame until one of the two has its front in the conflict."""
    map_ = twin_map("bendplatz")
    for number in np.random.default_rng(1).choice(len(samples), 40, replace=False):
        twin, ids, yielder = twin_traffic(scenes, str(samples.frame[number]))
        scene_id = str(samples.frame[number]).split(" ")[0]
        scene = scenes[scene_id]
        own = ids.index(yielder)
        expected = []
        for i, j in reference.conflicts(map_, twin).tolist():
            if i != own:
                continue
            conflict = reference.conflict_of(map_, twin, i, j)
            assert conflict is not None
            fronts = {}
            for vehicle, begin in ((i, conflict.begin_yielder), (j, conflict.begin_prioritized)):
                track = scene.track(ids[vehicle])
                inside = [k for k, s in enumerate(track.position) if s + track.length / 2 >= begin]
                fronts[vehicle] = track.start + inside[0] if inside else None
            mine, other = fronts[i], fronts[j]
            if mine is not None and (other is None or mine < other):
                expected.append(1)
            else:
                expected.append(0 if other is not None else UNKNOWN)
        assert samples.first[samples.sample == number].tolist() == expected


def test_a_sample_with_one_refused_pair_is_refused_whatever_the_others() -> None:
    features = np.zeros((6, 4), np.float32)
    first = np.array([1, 0, 1, UNKNOWN, 1, 1], np.int8)
    made = hand_made(features, first, np.array([0, 0, 1, 1, 2, 2]))
    chosen = made.select("all")
    assert chosen.labels().tolist() == [False, True]
    assert chosen.frame.tolist() == ["0", "2"], "an open pair among accepted ones leaves the label unknown"
    only_far = dataclasses.replace(made, recorded=np.array([1, 0, 1, 0, 0, 0], bool)).select("recorded")
    assert only_far.labels().tolist() == [True, True]
    assert only_far.frame.tolist() == ["0", "1"]


def test_planted_rule_is_learned_to_99_percent() -> None:
    network = train_network(planted_samples(6000, 0), planted_samples(500, 1), QUICK, progress=False)
    held_out = planted_samples(3000, 2)
    with torch.no_grad():
        accepts = network(torch.from_numpy(held_out.features)).numpy() > 0
    assert (held_out.decide(accepts) == held_out.labels()).mean() >= 0.99


def test_exported_network_equals_torch_in_the_core_and_in_onnx(tmp_path: Path) -> None:
    torch.manual_seed(3)
    network = GapNetwork()
    generator = np.random.default_rng(0)
    features = generator.uniform([0, 0, -20, 0], [40, 15, 120, 20], (1000, 4)).astype(np.float32)
    with torch.no_grad():
        truth = network(torch.from_numpy(features)).numpy()
    policy_file(network, {"made_by": "a test"}).save(tmp_path / "a.policy")
    read = PolicyFile.read(tmp_path / "a.policy")
    with torch.no_grad():
        again = gap_network(read)(torch.from_numpy(features)).numpy()
    np.testing.assert_array_equal(again, truth)
    core = _core.Policy(read.text(), "a").evaluate_gap(features)
    np.testing.assert_allclose(core, truth, atol=1e-6)
    save_onnx(network, tmp_path / "a.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx")
    np.testing.assert_allclose(session.run(None, {"features": features})[0], truth, atol=1e-6)
    with pytest.raises(ValueError, match='decides gaps by "sumo" and holds no gap network'):
        gap_network(PolicyFile("sumo", "idm"))


def unbroken_hash(tmp_path: Path, settings: GapSettings) -> str:
    folder = RunFolder.begin(tmp_path / "unbroken", decisive(settings), "data", resume=False)
    train_network(planted_samples(400, 0), planted_samples(100, 1), settings, folder, progress=False)
    return state_hash(folder.load())


TRAIN = """
import sys
from pathlib import Path
from agents.gap.train import GapSettings, train_network
from agents.training.folder import RunFolder, decisive
from tests.support.gap_fixture import planted_samples
import torch
torch.set_num_threads(1)
settings = GapSettings(epochs=60, batch=64, checkpoint_every=3, schedule=sys.argv[2])
folder = RunFolder.begin(Path(sys.argv[1]), decisive(settings), "data", resume=True)
train_network(planted_samples(400, 0), planted_samples(100, 1), settings, folder, progress=False)
"""


@pytest.mark.parametrize("schedule", ["falling", "cyclic"])
def test_run_killed_three_times_ends_like_an_unbroken_one(tmp_path: Path, schedule: str) -> None:
    settings = GapSettings(epochs=60, batch=64, checkpoint_every=3, schedule=schedule)  # type: ignore[arg-type]
    wanted = unbroken_hash(tmp_path, settings)
    command = [sys.executable, "-c", TRAIN, str(tmp_path / "broken"), schedule]
    generator = np.random.default_rng()
    for kill in range(3):
        process = subprocess.Popen(command, cwd=ROOT)
        checkpoint = tmp_path / "broken" / CHECKPOINT
        before = checkpoint.stat().st_mtime_ns if kill else 0
        while process.poll() is None and (not checkpoint.exists() or checkpoint.stat().st_mtime_ns == before):
            time.sleep(0.005)
        time.sleep(float(generator.uniform(0.0, 0.1)))
        process.send_signal(signal.SIGKILL)
        process.wait()
    subprocess.run(command, cwd=ROOT, check=True)
    folder = RunFolder(tmp_path / "broken")
    assert state_hash(folder.load()) == wanted
    assert (tmp_path / "broken" / METRICS).read_bytes() == (tmp_path / "unbroken" / METRICS).read_bytes()


def test_metrics_have_one_line_an_epoch(tmp_path: Path) -> None:
    settings = dataclasses.replace(QUICK, epochs=5, checkpoint_every=2)
    unbroken_hash(tmp_path, settings)
    rows = [json.loads(line) for line in (tmp_path / "unbroken" / METRICS).read_text().splitlines()]
    assert [row["epoch"] for row in rows] == [1, 2, 3, 4, 5]
    assert ["accuracy" in row for row in rows] == [False, True, False, True, True]


def test_run_with_other_settings_or_data_does_not_go_on(tmp_path: Path) -> None:
    RunFolder.begin(tmp_path, {"epochs": 5}, "one", resume=False)
    with pytest.raises(ValueError, match="holds a run already"):
        RunFolder.begin(tmp_path, {"epochs": 5}, "one", resume=False)
    with pytest.raises(ValueError, match='had "epochs" = 5, not 6'):
        RunFolder.begin(tmp_path, {"epochs": 6}, "one", resume=True)
    with pytest.raises(ValueError, match="= 'one', not 'two'"):
        RunFolder.begin(tmp_path, {"epochs": 5}, "two", resume=True)


def test_checkpoint_cut_short_is_named(tmp_path: Path) -> None:
    folder = RunFolder.begin(tmp_path, {}, "data", resume=False)
    folder.save({"epoch": 1, "network": GapNetwork().state_dict()})
    content = (tmp_path / CHECKPOINT).read_bytes()
    (tmp_path / CHECKPOINT).write_bytes(content[: len(content) // 2])
    with pytest.raises(ValueError, match=r"checkpoint\.pt is damaged"):
        folder.load()


def test_shipped_gap_policy_says_where_it_comes_from() -> None:
    policy = PolicyFile.read(ROOT / "intersection_env" / "policies" / "gap.policy")
    assert policy.about["made_by"] == "python -m agents.gap"
    assert policy.about["development"]["recorded"]["accuracy"] > 0.9
    assert Predictor.load("gap").policy.driver == "idm"

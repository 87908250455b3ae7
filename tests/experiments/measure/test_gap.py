"""Figures of gap decisions, and their intervals over recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.gap.baselines import BASELINES, EVEN, Decider, PairRule, SampleModel
from agents.gap.samples import GapSamples, Kinematics
from agents.gap.train import GapSettings
from agents.networks.gap import GapNetwork, least_logit
from experiments.measure.gap import Options, decider_of, main, on_folds, on_split
from experiments.measure.gap_acceptance import acceptance, acceptance_curves, critical_gap, seen_gap, typical_distances
from experiments.measure.gap_scores import compare, measures, tally
from experiments.show.gap import BINS, NETWORK, measures_table, plot_acceptance
from intersection_env.evaluation.intervals import RESAMPLES
from intersection_env.features import Gap
from tests.support.gap_samples import gap_samples_of, planted

ONCE = np.ones((1, 1))


def saying(probability: NDArray[np.float64]) -> Decider:
    """Says what it is told to, sample by sample."""
    return SampleModel(lambda _: probability)


def by_hand() -> GapSamples:
    """Three samples: one foe let pass; one foe preceded; two foes, one let pass and one of unknown order."""
    samples = gap_samples_of([(10.0, 0.0, d, 10.0) for d in (20.0, 80.0, 30.0, 90.0)], [0, 1, 0, -1], [0, 1, 2, 2])
    samples.kinematics[:, Kinematics.DISTANCE_TO_STOP_LINE] = (4.0, 3.0, -2.0, -2.0)
    return samples


def figures(decider: Decider, samples: GapSamples) -> dict[str, float]:
    return {key: float(value[0]) for key, value in measures(tally(decider, samples, ["00"]), ONCE).items()}


def in_recordings(samples: GapSamples, count: int) -> GapSamples:
    names = np.array([f"{k % count:02}" for k in range(len(samples))])
    return replace(samples, sample_recording=names)


def test_accuracies_are_those_counted_by_hand() -> None:
    accepts_beyond_25 = PairRule(lambda samples: samples.features[:, Gap.FOE_DISTANCE_TO_STOP_LINE] > 25.0)
    found = figures(accepts_beyond_25, by_hand())
    assert found["accuracy"] == pytest.approx(2 / 3)  # the third sample is wrong
    assert found["pair_accuracy"] == pytest.approx(2 / 3)  # of three pairs of known order, the third
    assert found["balanced_accuracy"] == pytest.approx(0.5 * (1.0 + 0.5))
    assert found["accuracy_before_stop_line"] == 1.0  # the third sample is beyond it
    assert found["base_rate"] == pytest.approx(2 / 3)
    assert "calibration_error" not in found


def test_always_waiting_is_as_accurate_as_the_base_rate() -> None:
    samples = planted(300)
    found = figures(BASELINES["always_wait"](samples), samples)
    assert found["accuracy"] == found["base_rate"]
    assert found["balanced_accuracy"] == 0.5


def test_perfectly_calibrated_probabilities_have_no_calibration_error() -> None:
    samples = gap_samples_of(np.ones((8, 4)), [1, 0, 0, 0, 1, 1, 1, 0])
    probability = np.array([0.25] * 4 + [0.75] * 4)
    assert figures(saying(probability), samples)["calibration_error"] == pytest.approx(0.0)


def test_calibration_error_is_the_gap_between_said_and_seen_weighted_by_bin() -> None:
    samples = gap_samples_of(np.ones((4, 4)), [1, 1, 0, 0])
    probability = np.array([0.6, 0.6, 0.6, 1.0])  # three samples say 0.6 where 2/3 are seen, one says 1 where 0 is
    expected = (3 * (2 / 3 - 0.6) + 1 * 1.0) / 4
    assert figures(saying(probability), samples)["calibration_error"] == pytest.approx(expected)


def test_probability_of_one_falls_into_the_last_bin() -> None:
    samples = gap_samples_of(np.ones((1, 4)), [1])
    bins = tally(saying(np.ones(1)), samples, ["00"]).bins
    assert bins is not None
    assert bins.shape == (1, BINS, 3)
    np.testing.assert_array_equal(bins[0, -1], [1.0, 1.0, 1.0])


def test_difference_of_identical_deciders_is_zero_with_no_width() -> None:
    samples = in_recordings(planted(400), 5)
    one = tally(BASELINES["logistic"](samples), samples, [f"{k:02}" for k in range(5)])
    difference = compare({NETWORK: one, "twin": one})["models"]["twin"]["network_minus"]
    assert len(difference) == 5
    assert all(interval == {"value": 0.0, "low": 0.0, "high": 0.0} for interval in difference.values())


def test_interval_is_over_recordings() -> None:
    # Ten recordings, of which five are all right and five all wrong: the mean of ten draws of 0 or 1.
    samples = in_recordings(gap_samples_of(np.ones((200, 4)), [0] * 200), 10)
    right = np.array([int(name) < 5 for name in samples.sample_recording])
    one = tally(saying(np.where(right, 0.1, 0.9)), samples, sorted(set(samples.sample_recording.tolist())))
    found = measures(one, np.random.default_rng(1).multinomial(10, np.full(10, 0.1), RESAMPLES).astype(float))
    assert found["accuracy"].std() == pytest.approx(np.sqrt(0.25 / 10), rel=0.1)


def test_shared_resamples_make_the_difference_sharper_than_either_accuracy() -> None:
    # Recordings differ a lot, and the network is right in one sample of twenty more in each of them.
    samples = in_recordings(gap_samples_of(np.ones((200, 4)), [0] * 190 + [1] * 10), 10)
    recording, place = samples.sample_recording.astype(int), np.arange(200) // 10
    worse, better = (saying(np.where(place < first + recording, 0.1, 0.9)) for first in (10, 11))
    names = [f"{k:02}" for k in range(10)]
    results = compare({NETWORK: tally(better, samples, names), "worse": tally(worse, samples, names)})["models"]
    difference, accuracy = results["worse"]["network_minus"]["accuracy"], results["worse"]["accuracy"]
    assert difference["high"] - difference["low"] < 0.2 * (accuracy["high"] - accuracy["low"])


def test_results_are_json_with_the_same_keys_for_both_kinds_of_foes() -> None:
    samples = in_recordings(planted(300), 3)
    results = on_split(GapNetwork(), samples, samples)
    assert json.loads(json.dumps(results)) == results
    assert list(results) == ["recorded", "all"]
    assert list(results["all"]["models"]) == [NETWORK, *BASELINES]
    assert results["all"]["models"]["boosting_three"]["pair_accuracy"] is None
    assert measures_table(results).count("| network |") == 2


def test_folds_judge_every_recording_once_by_models_that_have_not_seen_it() -> None:
    samples = in_recordings(planted(600), 6)
    result = on_folds(samples, 3, GapSettings(epochs=2, batch=256))["all"]
    assert (result["recordings"], result["samples"]) == (6, 600)
    assert len(result["models"][NETWORK]["fold_accuracies"]) == 3
    with pytest.raises(ValueError, match="wanted 3 to 6"):
        on_folds(samples, 7, GapSettings())


def test_critical_gap_is_where_acceptance_becomes_the_more_probable_for_good() -> None:
    seconds = np.linspace(0.0, 8.0, 161)
    assert critical_gap(1.0 / (1.0 + np.exp(-(seconds - 5.02)))) == pytest.approx(5.02, abs=1e-3)
    assert critical_gap(np.zeros(161)) is None
    assert critical_gap(np.ones(161)) is None
    assert critical_gap(np.where(np.abs(seconds - 2.0) < 0.5, 0.9, seconds / 8.0)) == pytest.approx(4.0)


def test_acceptance_is_asked_at_the_features_of_the_network() -> None:
    class Asked(GapNetwork):
        def forward(self, features: torch.Tensor) -> torch.Tensor:
            self.asked = features
            return features[:, Gap.FOE_DISTANCE_TO_STOP_LINE]

    network = Asked()
    chance = acceptance(network, 4.0, 14.0)
    assert chance[0] == 0.5
    np.testing.assert_allclose(network.asked[-1].numpy(), [14.0, 4.0, 8.0 * 50 / 3.6, 50 / 3.6], rtol=1e-6)


def test_distances_of_a_speed_are_medians_before_the_line() -> None:
    samples = gap_samples_of([(d, 4.0, 9.0, 9.0) for d in (10.0, 12.0, 20.0, 99.0)], [0] * 4)
    samples.kinematics[:, Kinematics.DISTANCE_TO_STOP_LINE] = (3.0, 4.0, 9.0, -1.0)
    assert typical_distances(samples, 4.5, merging=False) == (4.0, 12.0)
    with pytest.raises(ValueError, match="no yielder at about 8"):
        typical_distances(samples, 8.0, merging=False)


def test_figure_shows_both_kinds_of_conflict_and_reliability() -> None:
    samples = in_recordings(planted(300), 3)
    samples.features[:, Gap.SPEED] = np.arange(len(samples.features)) % 9
    samples.kinematics[:, Kinematics.MERGING] = np.arange(len(samples.features)) % 2
    network = GapNetwork()
    curves, by_foes = acceptance_curves(network, samples), on_split(network, samples, samples)
    figure = plot_acceptance(curves, EVEN, seen_gap(samples), by_foes)
    assert isinstance(figure, Figure)
    assert [axes.get_title() for axes in figure.axes] == ["Crossing", "Merging", "Reliability of the decisions"]


def test_network_decides_as_its_least_logit_says() -> None:
    samples, network = planted(200), GapNetwork()
    features, there = (torch.from_numpy(one) for one in samples.padded())
    with torch.no_grad():
        network.last.bias.sub_(least_logit(network, features, there).median())  # so that both decisions occur
        logit = least_logit(network, features, there)
    decider = decider_of(network)
    probability = decider.probability(samples)
    assert probability is not None
    np.testing.assert_allclose(probability, torch.sigmoid(logit).numpy(), rtol=1e-5)
    clear = np.abs(logit.numpy()) > 1e-6
    assert 50 < decider.decide(samples).sum() < 150
    np.testing.assert_array_equal(decider.decide(samples)[clear], logit.numpy()[clear] > 0.0)


def test_missing_scenes_and_a_figure_of_folds_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(scenes=(Path("nowhere.npz"),))) == 1
    assert "nowhere.npz" in capsys.readouterr().err
    assert main(Options(folds=5, figure=Path("gap.png"))) == 1
    assert "--figure" in capsys.readouterr().err

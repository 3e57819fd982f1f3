"""Rows in pieces: prepared models, merges, what a worker sends."""

import copy
import pickle

import numpy as np
import pytest
from elm_learn import ElmClassifier, ElmRegressor, merge
from sklearn.exceptions import NotFittedError


def rows(n=1200, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.uniform(-2, 2, (n, 3))
    return X, np.sin(X[:, 0]) * X[:, 1] + 0.01 * rng.standard_normal(n)


def labels(X):
    return np.array(["blue", "green", "red"])[np.digitize(X[:, 0] + X[:, 1], [-0.7, 0.7])]


def test_workers_models_merge_into_that_of_all_rows():
    X, y = rows()
    start = ElmRegressor(60, alpha=1e-8, random_state=0).prepare(X, y)
    parts = [copy.deepcopy(start).partial_fit(X[i::5], y[i::5]) for i in range(5)]
    before = pickle.dumps(parts[0])
    whole = merge(parts)
    batch = ElmRegressor(60, alpha=1e-8, random_state=0).fit(X, y)
    np.testing.assert_allclose(whole.predict(X), batch.predict(X), atol=1e-8)
    assert whole.n_rows_ == len(X) and parts[0].n_rows_ == 240 and start.n_rows_ == 0
    # What was merged is as it was: a worker may merge again.
    assert pickle.dumps(parts[0]) == before
    np.testing.assert_array_equal(merge(parts).predict(X), whole.predict(X))
    in_a_tree = merge([merge(parts[:2]), merge(parts[2:])])
    np.testing.assert_allclose(in_a_tree.predict(X), whole.predict(X), atol=1e-8)


def test_two_outputs_and_weights_merge():
    X, y = rows()
    Y, w = np.column_stack([y, y**2]), np.linspace(0, 2, len(y))
    start = ElmRegressor(40, alpha=1e-8, random_state=0).prepare(X, Y)
    parts = [copy.deepcopy(start).partial_fit(X[i::2], Y[i::2], w[i::2]) for i in range(2)]
    whole = copy.deepcopy(start).partial_fit(X, Y, w)
    assert merge(parts).predict(X).shape == (len(X), 2)
    np.testing.assert_allclose(merge(parts).predict(X), whole.predict(X), atol=1e-8)


def test_settings_are_chosen_on_the_sample():
    X, y = rows()
    model = ElmRegressor(random_state=0).prepare(X[:400], y[:400])
    model.partial_fit(X, y)
    assert model.score(X, y) > 0.99
    plain = ElmRegressor(60, scale="loo", random_state=0).prepare(X[:400], y[:400])
    assert plain.partial_fit(X, y).score(X, y) > 0.98


def test_classifiers_merge_though_parts_lack_classes():
    X, _ = rows()
    y = labels(X)
    start = ElmClassifier(60, alpha=1e-6, random_state=0).prepare(X, y)
    parts = [copy.deepcopy(start).partial_fit(X[y == label], y[y == label]) for label in np.unique(y)]
    whole = merge(parts)
    batch = copy.deepcopy(start).partial_fit(X, y)
    np.testing.assert_allclose(whole.predict_proba(X), batch.predict_proba(X), atol=1e-6)
    assert whole.score(X, y) > 0.95
    auto = ElmClassifier(random_state=0).prepare(X[:300], y[:300])
    assert auto.partial_fit(X, y).score(X, y) > 0.95


def test_a_compact_model_is_small_and_the_same():
    X, y = rows(4000)
    model = ElmRegressor(100, random_state=0).prepare(X, y).partial_fit(X[:350], y[:350])
    expected, large = model.predict(X), len(pickle.dumps(model))
    small = pickle.dumps(model.compact())
    assert len(small) < 8 * 102 * 103 / 2 + 10_000 < large / 2
    np.testing.assert_array_equal(pickle.loads(small).predict(X), expected)


def test_what_drifts_is_followed():
    X, _ = rows(300)
    model = ElmRegressor(20, random_state=0).prepare(X, X[:, 0])
    for day in range(20):
        model.forget(0.5).partial_fit(X, day * X[:, 0])
    # The mean of 19, 18, 17 and so on, each of half the weight of the one before.
    slope = model.predict(X) @ X[:, 0] / (X[:, 0] @ X[:, 0])
    assert 17.8 < slope < 18.2
    y = labels(X)
    classes = ElmClassifier(20, random_state=0).prepare(X, y).partial_fit(X, np.roll(y, 1))
    assert classes.forget(0.0).partial_fit(X, y).score(X, y) > 0.9
    with pytest.raises(ValueError, match="factor"):
        model.forget(2.0)


def test_what_does_not_fit_together_says_so():
    X, y = rows()
    one = ElmRegressor(20, random_state=0).prepare(X, y)
    with pytest.raises(ValueError, match="random layers"):
        merge([one, ElmRegressor(20, random_state=1).prepare(X, y)])
    with pytest.raises(ValueError, match="scalers"):
        merge([one, ElmRegressor(20, random_state=0).prepare(2 * X, y)])
    with pytest.raises(ValueError, match="at least one"):
        merge([])
    with pytest.raises(TypeError, match="ElmClassifier into ElmRegressor"):
        merge([one, ElmClassifier(20, random_state=0).prepare(X, labels(X))])
    with pytest.raises(NotFittedError):
        merge([ElmRegressor(20)])
    with pytest.raises(ValueError, match="prepare or partial_fit"):
        merge([ElmRegressor(20).fit(X, y)])
    assert not hasattr(ElmRegressor(20).fit(X, y), "n_rows_")
    other = ElmClassifier(20, random_state=0).prepare(X, np.sign(X[:, 0]))
    with pytest.raises(ValueError, match="classes"):
        merge([ElmClassifier(20, random_state=0).prepare(X, labels(X)), other])
    with pytest.raises(ValueError, match="features"):
        one.partial_fit(X[:, :2], y)
    # No rows yet.
    with pytest.raises(ValueError, match="accumulator"):
        one.predict(X)

"""What the estimators promise beyond scikit-learn's checks."""

import pickle
import subprocess
import sys
import threading

import joblib
import numpy as np
import pytest
from sklearn import inspection
from sklearn.datasets import load_diabetes, load_iris, make_classification
from sklearn.exceptions import NotFittedError
from sklearn.metrics import log_loss

from elm_learn import ElmClassifier, ElmRegressor


@pytest.fixture
def curve():
    rng = np.random.default_rng(0)
    X = rng.uniform(-3, 3, (300, 2))
    return X, np.sin(X[:, 0]) + 0.3 * X[:, 1] + 0.05 * rng.normal(size=300)


def test_one_target_gives_one_dimension_and_several_give_two(curve):
    X, y = curve
    assert ElmRegressor(50).fit(X, y).predict(X).shape == (300,)
    assert ElmRegressor(50).fit(X, y[:, None]).predict(X).shape == (300, 1)
    assert ElmRegressor(50).fit(X, np.c_[y, -y]).predict(X).shape == (300, 2)


def test_float32_stays_and_agrees(curve):
    X, y = curve
    model = ElmRegressor(50, random_state=0).fit(X.astype(np.float32), y)
    y32 = model.predict(X.astype(np.float32))
    assert y32.dtype == np.float32
    y64 = ElmRegressor(50, random_state=0).fit(X, y).predict(X)
    assert np.abs(y32 - y64).max() < 1e-2
    p = ElmClassifier(20).fit(X.astype(np.float32), y > 0).predict_proba(X.astype(np.float32))
    assert p.dtype == np.float32


def test_leave_one_out_score_is_near_the_test_score(curve):
    X, y = curve
    model = ElmRegressor(random_state=0).fit(X[:200], y[:200])
    assert abs(model.loo_score_ - model.score(X[200:], y[200:])) < 0.02
    assert model.feature_importances_.shape == (2,)
    assert abs(model.feature_importances_.sum() - 1) < 1e-12


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_permutation_importance_finds_what_matters(dtype):
    random = np.random.default_rng(1)
    X = random.uniform(-1, 1, (300, 3)).astype(dtype)
    y = np.sin(3 * X[:, 0]) + 0.3 * X[:, 1] + 0.05 * random.normal(size=300)
    weights = random.uniform(0.5, 1.5, 300)
    for model in (ElmRegressor(60, random_state=0), ElmRegressor(random_state=0)):
        model.fit(X, y, sample_weight=weights)
        found = pickle.loads(pickle.dumps(model)).permutation_importance(X, y, weights, n_repeats=4)
        assert found.importances.shape == (3, 4)
        first, second, third = found.importances_mean
        assert first > 1.5 and 0.05 < second < 0.3 and abs(third) < 0.01
        # Close to what scikit-learn finds on rows that the model has not seen.
        X_new = random.uniform(-1, 1, (1000, 3)).astype(dtype)
        y_new = np.sin(3 * X_new[:, 0]) + 0.3 * X_new[:, 1] + 0.05 * random.normal(size=1000)
        theirs = inspection.permutation_importance(model, X_new, y_new, random_state=0)
        np.testing.assert_allclose(found.importances_mean, theirs.importances_mean, rtol=0.15, atol=0.01)
    with pytest.raises(ValueError, match="n_repeats must be at least 1"):
        model.permutation_importance(X, y, n_repeats=0)


def test_intervals_cover_and_deviations_grow_outside(curve):
    X, y = curve
    model = ElmRegressor(40, intervals=True, random_state=0).fit(X[:200], y[:200])
    low, high = model.predict_interval(X[200:], alpha=0.1)
    assert 0.8 < np.mean((low <= y[200:]) & (y[200:] <= high)) <= 1
    inside, outside = model.predict_std(np.array([[0.0, 0.0], [9.0, 0.0]]))
    assert outside > 2 * inside
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.predict_interval(X), model.predict_interval(X))
    np.testing.assert_array_equal(again.predict(X), model.predict(X))
    with pytest.raises(ValueError, match="intervals=True"):
        ElmRegressor(40, random_state=0).fit(X, y).predict_interval(X)


@pytest.mark.parametrize("kind", [ElmRegressor, ElmClassifier])
def test_pickles_give_the_same_bits_in_another_process(kind, curve, tmp_path):
    X, y = curve
    model = kind(30, random_state=0).fit(X, y if kind is ElmRegressor else y > 0)
    predict = "predict" if kind is ElmRegressor else "predict_proba"
    joblib.dump(model, tmp_path / "model")
    np.save(tmp_path / "x.npy", X)
    script = (
        "import joblib, numpy as np\n"
        f"model = joblib.load(r'{tmp_path / 'model'}')\n"
        f"np.save(r'{tmp_path / 'y.npy'}', model.{predict}(np.load(r'{tmp_path / 'x.npy'}')))"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "y.npy"), getattr(model, predict)(X))


@pytest.mark.parametrize("kind", [ElmRegressor, ElmClassifier])
def test_damaged_states_are_clear_errors(kind, curve):
    X, y = curve
    state = kind(10, random_state=0).fit(X, y > 0).__getstate__()
    payload = state["_network"]
    assert isinstance(payload, bytes)
    altered = bytearray(payload)
    altered[len(payload) // 2] ^= 1
    later = bytearray(payload)
    later[8] = 250
    cases = [(payload[:-5], "cut short"), (bytes(altered), "damaged"), (bytes(later), "version")]
    for wrong, words in cases:
        with pytest.raises(ValueError, match=words):
            kind().__setstate__({**state, "_network": wrong})


def test_pieces_give_what_all_rows_give(curve):
    X, y = curve
    whole = ElmRegressor(40, alpha="gcv", random_state=0).fit(X, y)
    pieces = ElmRegressor(40, alpha="gcv", random_state=0)
    # The first piece standardizes: all rows, so that the layers are the same.
    pieces.partial_fit(X, y, sample_weight=np.r_[np.ones(100), np.zeros(200)])
    pieces.partial_fit(X[100:200], y[100:200])
    pieces = pickle.loads(pickle.dumps(pieces))
    pieces.partial_fit(X[200:], y[200:])
    np.testing.assert_allclose(pieces.predict(X), whole.predict(X), atol=1e-6)


def test_classes_may_be_missing_in_a_piece():
    X, y = load_iris(return_X_y=True)
    model = ElmClassifier(40, random_state=0)
    order = np.random.default_rng(0).permutation(150)
    model.partial_fit(X[order[:30]], y[order[:30]], classes=[0, 1, 2])
    for label in (0, 1, 2):
        rows = order[30:][y[order[30:]] == label]
        model.partial_fit(X[rows], y[rows])
    assert model.score(X, y) > 0.95
    np.testing.assert_allclose(model.predict_proba(X).sum(axis=1), 1, atol=1e-12)
    with pytest.raises(ValueError, match="none of classes_"):
        model.partial_fit(X[:1], [7])


def test_weights_of_classes_and_texts_as_labels():
    X, y = make_classification(600, weights=[0.9], flip_y=0.1, random_state=0)
    labels = np.array(["no", "yes"])[y]
    plain = ElmClassifier(30, random_state=0).fit(X, labels)
    balanced = ElmClassifier(30, class_weight="balanced", random_state=0).fit(X, labels)
    assert (balanced.predict(X) == "yes").mean() > (plain.predict(X) == "yes").mean()
    given = ElmClassifier(30, class_weight={"yes": 5.0}, random_state=0).fit(X, labels)
    assert (given.predict(X) == "yes").mean() > (plain.predict(X) == "yes").mean()
    assert log_loss(labels, plain.predict_proba(X)) < 0.4


def test_threads_change_no_bit_and_fits_at_once_are_right(curve):
    X, y = curve
    X, y = np.tile(X, (20, 1)), np.tile(y, 20)
    expected = ElmRegressor(50, random_state=0).fit(X, y).predict(X)
    several = ElmRegressor(50, random_state=0, n_jobs=3).fit(X, y).predict(X)
    np.testing.assert_array_equal(several, expected)
    results = [None] * 8

    def run(place):
        results[place] = ElmRegressor(50, random_state=0).fit(X, y).predict(X)

    threads = [threading.Thread(target=run, args=(place,)) for place in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for result in results:
        np.testing.assert_array_equal(result, expected)


def test_strided_inputs_are_read_as_they_are(curve):
    X, y = curve
    model = ElmRegressor(30, random_state=0)
    plain = model.fit(X, y).predict(X)
    columns = np.asfortranarray(X)
    every = np.repeat(X, 2, axis=0)[::2]
    np.testing.assert_allclose(model.fit(columns, y).predict(every), plain, atol=1e-9)


@pytest.mark.parametrize("kind", [ElmRegressor, ElmClassifier])
def test_errors_say_what_was_expected(kind):
    X, y = load_diabetes(return_X_y=True)
    y = (y > 100).astype(int)
    with pytest.raises(NotFittedError):
        kind().predict(X)
    for settings, words in (
        ({"n_neurons": 0}, "n_neurons"),
        ({"n_neurons": 10, "activation": "tan"}, "activation"),
        ({"n_neurons": 10, "scale": -1.0}, "scale"),
        ({"n_neurons": 10, "alpha": "cv"}, "alpha"),
        ({"activation": "sine"}, "n_neurons='auto'"),
    ):
        with pytest.raises(ValueError, match=words):
            kind(**settings).fit(X, y)
    with pytest.raises(ValueError, match="10 features"):
        kind(10).fit(X, y).predict(X[:, :3])

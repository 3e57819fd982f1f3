"""ONNX graphs against the models themselves, over 10,000 rows and all activation functions."""

import numpy as np
import pytest

from elm_learn import ElmClassifier, ElmRegressor

ort = pytest.importorskip("onnxruntime")
ACTIVATIONS = [
    "sigmoid",
    "tanh",
    "sine",
    "gaussian",
    "relu",
    "squared-relu",
    "hard-limit",
    "isru",
    "linear",
]


def rows(count, seed):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(count, 5))
    return X, np.sin(X[:, 0]) + X[:, 1] * X[:, 2]


def run(path, X):
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": X})


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("kind", [ElmRegressor, ElmClassifier])
def test_graphs_give_the_same_values(kind, activation, double, tmp_path):
    X, y = rows(500, 0)
    if kind is ElmClassifier:
        y = np.digitize(y, [-0.5, 0.5])
    links = activation in ("relu", "sine")
    model = kind(80, activation=activation, direct_links=links, random_state=0).fit(X, y)
    model.to_onnx(tmp_path / "model.onnx", double=double)
    new = rows(10_000, 1)[0].astype(np.float32)
    out = run(tmp_path / "model.onnx", new.astype(np.float64 if double else np.float32))
    new = new.astype(np.float64)
    tolerance = 1e-12 if double else 1e-6
    if kind is ElmRegressor:
        expected = model.predict(new)
        assert np.abs(out[0][:, 0] - expected).max() <= tolerance * np.abs(expected).max()
    else:
        expected = model.predict_proba(new)
        assert np.abs(out[1] - expected).max() <= tolerance
        assert (model.classes_[out[0]] == model.predict(new)).mean() > 0.9999


def test_two_classes_and_auto(tmp_path):
    X, y = rows(300, 2)
    model = ElmClassifier(random_state=0).fit(X, y > 0)
    model.to_onnx(tmp_path / "model.onnx", double=True)
    label, p = run(tmp_path / "model.onnx", X)
    np.testing.assert_allclose(p, model.predict_proba(X), atol=1e-12)
    np.testing.assert_array_equal(model.classes_[label], model.predict(X))

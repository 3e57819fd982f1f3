"""scikit-learn's own checks, all of them."""

import os

# Without it one check is skipped.
os.environ["SCIPY_ARRAY_API"] = "1"


import numpy as np
import pytest
from sklearn.base import clone
from sklearn.datasets import load_diabetes, load_iris
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from elm_learn import ElmClassifier, ElmRegressor


@parametrize_with_checks(
    [
        ElmRegressor(),
        ElmClassifier(),
        ElmRegressor(n_neurons=50),
        ElmClassifier(n_neurons=50),
    ],
)
def test_check_estimator(estimator, check):
    check(estimator)


def test_pipelines_searches_and_clones():
    X, y = load_iris(return_X_y=True)
    pipeline = make_pipeline(StandardScaler(), ElmClassifier(40, random_state=0))
    assert cross_val_score(pipeline, X, y, cv=5).mean() > 0.93
    search = GridSearchCV(
        ElmClassifier(random_state=0), {"n_neurons": [10, 40], "activation": ["sine", "tanh"]}, cv=3
    )
    search.fit(X, y)
    assert search.best_score_ > 0.93
    assert clone(search.best_estimator_).get_params() == search.best_estimator_.get_params()


@pytest.mark.parametrize("frames", ["pandas", "polars"])
def test_frames(frames):
    library = pytest.importorskip(frames)
    X, y = load_diabetes(return_X_y=True)
    names = [f"x{i}" for i in range(X.shape[1])]
    frame = library.DataFrame({name: X[:, i] for i, name in enumerate(names)})
    model = ElmRegressor(30, random_state=0).fit(frame, y)
    assert list(model.feature_names_in_) == names
    np.testing.assert_array_equal(
        model.predict(frame), ElmRegressor(30, random_state=0).fit(X, y).predict(X)
    )

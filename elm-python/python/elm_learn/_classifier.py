"""Classification."""

from __future__ import annotations

import numpy as np
from sklearn.base import ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import (
    check_is_fitted,
    column_or_1d,
    validate_data,
)

from ._base import FLOATS, ElmBase, interruptible
from ._elm_learn import Classifier, ClassRows


class ElmClassifier(ClassifierMixin, ElmBase):
    """Extreme learning machine for classification, with calibrated probabilities.

    A ridge solve for 0 and 1 of each class; its scores become log-odds by a slope and shifts fitted to exact
    leave-one-out scores.

    Parameters
    ----------
    n_neurons : int or "auto", default="auto"
        Number of hidden neurons. "auto" chooses neurons, scale of the random weights, a scale for each
        input, direct links and, unless `alpha` is given, regularization by leave-one-out errors.
    activation : str, default="tanh"
        One of "sigmoid", "tanh", "sine", "gaussian", "relu", "squared-relu", "hard-limit", "isru",
        "linear".
    scale : float, "auto" or "loo", default="auto"
        Factor of the random weights, which are uniform in [-1, 1]. "auto" is 1 where neurons are given;
        "loo" searches for it by leave-one-out, at the cost of some 24 fits.
    alpha : float, "loo" or "gcv", default="loo"
        Strength of ridge relative to the largest squared singular value of the hidden-layer matrix, one for
        all classes; chosen by exact leave-one-out or by generalized cross-validation.
    direct_links : bool, default=False
        Whether inputs also reach the outputs directly (RVFL).
    class_weight : dict, "balanced" or None, default=None
        What the rows of each class count for.
    random_state : int, RandomState instance or None, default=None
        Seeds the random layer; an int gives the same model on every machine.
    n_jobs : int or None, default=None
        Threads of fits and predictions; -1 for all cores. The result is the same for any number.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The classes, rising.
    n_neurons_ : int
        Number of hidden neurons.
    alpha_ : ndarray
        Strength of ridge.
    loo_rmse_ : ndarray or None
        Exact leave-one-out root mean squared error of the 0 and 1 of each class (of two, of the second).
    n_features_in_ : int
        Number of inputs.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of inputs, where `X` had any.

    Examples
    --------
    >>> from sklearn.datasets import load_iris
    >>> from elm_learn import ElmClassifier
    >>> X, y = load_iris(return_X_y=True)
    >>> model = ElmClassifier(50, random_state=0).fit(X, y)
    >>> model.predict_proba(X[:2]).shape
    (2, 3)
    """

    _NETWORK = Classifier
    _ROWS = ClassRows

    def __init__(
        self,
        n_neurons="auto",
        *,
        activation="tanh",
        scale="auto",
        alpha="loo",
        direct_links=False,
        class_weight=None,
        random_state=None,
        n_jobs=None,
    ):
        self.n_neurons = n_neurons
        self.activation = activation
        self.scale = scale
        self.alpha = alpha
        self.direct_links = direct_links
        self.class_weight = class_weight
        self.random_state = random_state
        self.n_jobs = n_jobs

    def fit(self, X, y, sample_weight=None):
        """Draw the layer, solve for the scores of classes, and calibrate.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs; a float64 or float32 array is not copied, and its type is that of all that follows.
        y : array-like of shape (n_samples,)
            Labels.
        sample_weight : array-like of shape (n_samples,), default=None
            What each row counts for.

        Returns
        -------
        self : ElmClassifier
        """
        X, y = validate_data(self, X, y, dtype=FLOATS)
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        settings = self._settings()
        self.classes_, codes = np.unique(y, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError(
                "ElmClassifier needs rows of at least 2 classes, but the data has only one class: "
                f"{self.classes_[0]!r}"
            )
        weights = self._weights(X, sample_weight)
        X, codes, weights = self._arranged(X, codes, weights)
        balanced = isinstance(self.class_weight, str) and self.class_weight == "balanced"
        arguments = (
            settings,
            X,
            codes.astype(np.uint32),
            len(self.classes_),
            weights,
            None if balanced else self._class_weights(),
            balanced,
        )
        network = interruptible(self._work(X), Classifier.fit, *arguments)
        self._rows = None
        self._network = network
        self._describe(network)
        self._set_importances(network)
        return self

    def prepare(self, X, y, classes=None):
        """Draw the layer for rows like these and take none in: what workers and :func:`merge` begin with.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            A sample of the rows to come; it standardizes the inputs.
        y : array-like of shape (n_samples,)
            Its labels, for settings that are to be chosen (``n_neurons="auto"``, ``scale="loo"``).
        classes : array-like of shape (n_classes,), default=None
            All classes; those of the sample if not given.

        Returns
        -------
        self : ElmClassifier
        """
        X, y = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        settings = self._settings()
        self._name_classes(np.unique(y) if classes is None else np.unique(classes))
        X, codes = self._arranged(X, self._codes(y))
        arguments = (settings, X, codes, len(self.classes_), self._class_weights())
        self._begin(interruptible(self._work(X), ClassRows.prepare, *arguments))
        return self

    def _name_classes(self, classes):
        if isinstance(self.class_weight, str):
            raise ValueError(
                f"class_weight={self.class_weight!r} needs all rows: give a dict for rows in pieces"
            )
        if len(classes) < 2:
            raise ValueError("ElmClassifier needs at least 2 classes, got only one class")
        self.classes_ = classes

    def _codes(self, y):
        codes = np.searchsorted(self.classes_, y)
        codes = np.minimum(codes, len(self.classes_) - 1)
        unknown = self.classes_[codes] != y
        if unknown.any():
            raise ValueError(f"the label {y[unknown][0]!r} is none of classes_")
        return codes.astype(np.uint32)

    def partial_fit(self, X, y, classes=None, sample_weight=None):
        """Take in more rows; the memory that is needed does not grow with them.

        The first rows standardize the inputs, so they should be like those to come. ``n_neurons="auto"`` is
        200 here, ``scale="loo"`` is 1, unless :meth:`prepare` has chosen them; ridge is chosen by
        generalized cross-validation.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.
        y : array-like of shape (n_samples,)
            Labels; some classes may be missing.
        classes : array-like of shape (n_classes,), default=None
            All classes; needed at the first call, unless there was a fit before it.
        sample_weight : array-like of shape (n_samples,), default=None
            What each row counts for.

        Returns
        -------
        self : ElmClassifier
        """
        first = getattr(self, "_rows", None) is None
        X, y = validate_data(self, X, y, reset=first, dtype=np.float64)
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        if first:
            if classes is None:
                # After a fit, as scikit-learn's own classifiers have it.
                classes = getattr(self, "classes_", None)
            if classes is None:
                raise ValueError("classes must be passed on the first call to partial_fit")
            self._name_classes(np.unique(classes))
        elif classes is not None and not np.array_equal(np.unique(classes), self.classes_):
            raise ValueError(f"classes={classes!r} are not those of the first call")
        codes = self._codes(y)
        weights = self._weights(X, sample_weight)
        if first:
            settings = self._settings(partial=True)
            self._begin(ClassRows.prepare(settings, X, codes, len(self.classes_), None))
        self._rows.push(X, codes, weights, self._class_weights(), self._threads())
        self._network = None
        return self

    def _class_weights(self):
        if self.class_weight is None:
            return None
        if not isinstance(self.class_weight, dict):
            raise ValueError(
                f"class_weight must be a dict, 'balanced' or None, got {self.class_weight!r}"
            )
        return [float(self.class_weight.get(label, 1.0)) for label in self.classes_.tolist()]

    def predict_proba(self, X):
        """The probability of each class.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.

        Returns
        -------
        p : ndarray of shape (n_samples, n_classes)
            In the order of `classes_`; 1 in sum over a row.
        """
        X = self._inputs(X)
        return self._fitted().predict_proba(X, self._threads())

    def decision_function(self, X):
        """Log-odds of classes.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.

        Returns
        -------
        z : ndarray of shape (n_samples,) or (n_samples, n_classes)
            Of two classes those of the second against the first; of more, up to a number common to a row.
        """
        X = self._inputs(X)
        z = self._fitted().decision_function(X)
        return z[:, 0] if len(self.classes_) == 2 else z

    def predict(self, X):
        """The most probable class.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.

        Returns
        -------
        y : ndarray of shape (n_samples,)
        """
        check_is_fitted(self)
        z = self.decision_function(X)
        codes = (z > 0).astype(int) if z.ndim == 1 else z.argmax(axis=1)
        return self.classes_[codes]

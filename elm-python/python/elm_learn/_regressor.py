"""Regression."""

from __future__ import annotations

from numbers import Integral

import numpy as np
from sklearn.base import RegressorMixin
from sklearn.utils import Bunch, check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from ._base import FLOATS, ElmBase, interruptible
from ._elm_learn import Network, Rows


class ElmRegressor(RegressorMixin, ElmBase):
    """Extreme learning machine for regression: random hidden neurons, one ridge solve.

    Inputs are standardized. Predictions outside the range of the training rows are held at its edge.

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
        Strength of ridge relative to the largest squared singular value of the hidden-layer matrix; chosen
        by exact leave-one-out or by generalized cross-validation.
    direct_links : bool, default=False
        Whether inputs also reach the outputs directly (RVFL).
    intervals : bool, default=False
        Whether to keep what :meth:`predict_interval` and :meth:`predict_std` need: the square of the neurons
        in numbers, and one for each row and output.
    random_state : int, RandomState instance or None, default=None
        Seeds the random layer; an int gives the same model on every machine.
    n_jobs : int or None, default=None
        Threads of fits and predictions; -1 for all cores. The result is the same for any number.

    Attributes
    ----------
    n_neurons_ : int
        Number of hidden neurons.
    alpha_ : ndarray of shape (n_outputs,)
        Strength of ridge.
    loo_rmse_ : ndarray of shape (n_outputs,) or None
        Exact leave-one-out root mean squared error.
    loo_score_ : float or None
        Mean over outputs of the leave-one-out R2.
    n_features_in_ : int
        Number of inputs.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of inputs, where `X` had any.

    Examples
    --------
    >>> import numpy as np
    >>> from elm_learn import ElmRegressor
    >>> X = np.linspace(-3, 3, 100)[:, None]
    >>> model = ElmRegressor(30, random_state=0).fit(X, np.sin(X[:, 0]))
    >>> round(model.score(X, np.sin(X[:, 0])), 3)
    1.0
    """

    _NETWORK = Network
    _ROWS = Rows

    def __init__(
        self,
        n_neurons="auto",
        *,
        activation="tanh",
        scale="auto",
        alpha="loo",
        direct_links=False,
        intervals=False,
        random_state=None,
        n_jobs=None,
    ):
        self.n_neurons = n_neurons
        self.activation = activation
        self.scale = scale
        self.alpha = alpha
        self.direct_links = direct_links
        self.intervals = intervals
        self.random_state = random_state
        self.n_jobs = n_jobs

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def fit(self, X, y, sample_weight=None):
        """Draw the layer and solve for the output weights.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs; a float64 or float32 array is not copied, and its type is that of all that follows.
        y : array-like of shape (n_samples,) or (n_samples, n_outputs)
            Targets.
        sample_weight : array-like of shape (n_samples,), default=None
            What the squared residual of each row counts for.

        Returns
        -------
        self : ElmRegressor
        """
        X, y = validate_data(
            self, X, y, dtype=FLOATS, multi_output=True, y_numeric=True
        )
        settings = self._settings()
        y = np.asarray(y, dtype=X.dtype)
        weights = self._weights(X, sample_weight)
        self._single = y.ndim == 1
        targets = y[:, None] if self._single else y
        X, targets, weights = self._arranged(X, targets, weights)
        arguments = (settings, X, targets, weights, bool(self.intervals))
        network = interruptible(self._work(X), Network.fit, *arguments)
        self._rows = None
        self._network = network
        self._describe(network)
        self._set_importances(network)
        self.loo_score_ = None
        if self.loo_rmse_ is not None:
            variance = np.average(
                (targets - np.average(targets, axis=0, weights=weights)) ** 2,
                axis=0,
                weights=weights,
            )
            known = variance > 0
            if known.any():
                self.loo_score_ = float(np.mean(1 - self.loo_rmse_[known] ** 2 / variance[known]))
        return self

    def prepare(self, X, y):
        """Draw the layer for rows like these and take none in: what workers and :func:`merge` begin with.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            A sample of the rows to come; it standardizes the inputs.
        y : array-like of shape (n_samples,) or (n_samples, n_outputs)
            Its targets, for settings that are to be chosen (``n_neurons="auto"``, ``scale="loo"``).

        Returns
        -------
        self : ElmRegressor
        """
        X, y = validate_data(self, X, y, dtype=np.float64, multi_output=True, y_numeric=True)
        settings = self._settings()
        y = np.asarray(y, dtype=np.float64)
        targets = y[:, None] if y.ndim == 1 else y
        X, targets = self._arranged(X, targets)
        self._begin(interruptible(self._work(X), Rows.prepare, settings, X, targets))
        self._single = y.ndim == 1
        return self

    def partial_fit(self, X, y, sample_weight=None):
        """Take in more rows; the memory that is needed does not grow with them.

        The first rows standardize the inputs, so they should be like those to come. The answer is that of
        a fit to all rows, with ridge chosen by generalized cross-validation. ``n_neurons="auto"`` is 200
        here, ``scale="loo"`` is 1, unless :meth:`prepare` has chosen them.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.
        y : array-like of shape (n_samples,) or (n_samples, n_outputs)
            Targets.
        sample_weight : array-like of shape (n_samples,), default=None
            What the squared residual of each row counts for.

        Returns
        -------
        self : ElmRegressor
        """
        first = getattr(self, "_rows", None) is None
        X, y = validate_data(
            self, X, y, reset=first, dtype=np.float64, multi_output=True, y_numeric=True
        )
        weights = self._weights(X, sample_weight)
        y = np.asarray(y, dtype=np.float64)
        targets = y[:, None] if y.ndim == 1 else y
        if first:
            self._begin(Rows.prepare(self._settings(partial=True), X, targets))
            self._single = y.ndim == 1
        self._rows.push(X, targets, weights, self._threads())
        self._network = None
        return self

    def predict(self, X):
        """Predict.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.

        Returns
        -------
        y : ndarray of shape (n_samples,) or (n_samples, n_outputs)
            As the targets were.
        """
        X = self._inputs(X)
        y = self._fitted().predict(X, self._threads())
        return y[:, 0] if self._single else y

    def predict_interval(self, X, alpha=0.1):
        """Intervals that hold a new observation with probability 1 - `alpha` (studentized jackknife).

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.
        alpha : float, default=0.1
            The share of observations that may lie outside, above 0 and below 1.

        Returns
        -------
        lower, upper : ndarray of shape (n_samples,) or (n_samples, n_outputs)
            Ends; infinite where there are too few rows for so small an `alpha`.
        """
        X = self._inputs(X)
        low, high = np.split(self._uncertain().predict_interval(X, 1.0 - alpha), 2, axis=1)
        return (low[:, 0], high[:, 0]) if self._single else (low, high)

    def predict_std(self, X):
        """The standard deviation of a new observation; it grows outside the training rows.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            Inputs.

        Returns
        -------
        std : ndarray of shape (n_samples,) or (n_samples, n_outputs)
        """
        X = self._inputs(X)
        deviation = self._uncertain().predict_deviation(X)
        return deviation[:, 0] if self._single else deviation

    def permutation_importance(self, X, y, sample_weight=None, n_repeats=5):
        """By how much the leave-one-out R2 falls where an input has the values of other rows.

        Unlike :func:`sklearn.inspection.permutation_importance` it needs no rows that were set aside: each row
        is predicted by the fit without it, exactly and without fitting again. Of inputs that say the same
        neither is important, as the other is still there.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features)
            The inputs that were fitted to.
        y : array-like of shape (n_samples,) or (n_samples, n_outputs)
            Their targets.
        sample_weight : array-like of shape (n_samples,), default=None
            Their weights.
        n_repeats : int, default=5
            Permutations of each input, seeded by `random_state`.

        Returns
        -------
        result : :class:`sklearn.utils.Bunch`
            ``importances`` of shape (n_features, n_repeats), the mean over outputs, and its
            ``importances_mean`` and ``importances_std`` of shape (n_features,), as scikit-learn's has them.
        """
        check_is_fitted(self)
        network = self._fitted()
        X, y = validate_data(
            self, X, y, reset=False, dtype=network.dtype, multi_output=True, y_numeric=True
        )
        if not isinstance(n_repeats, Integral) or isinstance(n_repeats, bool) or n_repeats < 1:
            raise ValueError(f"n_repeats must be at least 1, got {n_repeats!r}")
        y = np.asarray(y, dtype=X.dtype)
        targets = y[:, None] if y.ndim == 1 else y
        weights = self._weights(X, sample_weight)
        seed = check_random_state(self.random_state).randint(2**31)
        work = self._work(X) * X.shape[1] * n_repeats
        arguments = (self._settings(), X, targets, weights, int(n_repeats), seed)
        falls = interruptible(work, network.permutation_importance, *arguments)
        return Bunch(
            importances=falls,
            importances_mean=falls.mean(axis=1),
            importances_std=falls.std(axis=1),
        )

    def _uncertain(self):
        check_is_fitted(self)
        network = self._fitted()
        if not network.has_intervals:
            raise ValueError(
                "this model has no intervals: fit with intervals=True (partial_fit has none)"
            )
        return network

"""What both estimators share: parameters, threads, interrupts, files."""

from __future__ import annotations

import copy
import os
import threading
from numbers import Integral, Real

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data

from ._elm_learn import SEARCH_ROWS, Settings

#: Neurons of ``partial_fit`` where their number is to be chosen.
PARTIAL_NEURONS = 200
#: Multiply-adds from which a fit runs where Ctrl-C can end the wait for it.
LONG = 2e9
FLOATS = (np.float64, np.float32)


def merge(models):
    """One model of all rows that several have taken in by ``partial_fit``, each from a copy of one that was prepared.

    The models do not change, so that a worker may repeat a merge. The order of rows and of merges changes the
    result by rounding errors alone.

    Parameters
    ----------
    models : iterable of ElmRegressor or of ElmClassifier
        At least one.

    Returns
    -------
    model : ElmRegressor or ElmClassifier

    Examples
    --------
    >>> import copy
    >>> import numpy as np
    >>> from elm_learn import ElmRegressor, merge
    >>> X = np.linspace(-3, 3, 200)[:, None]
    >>> y = np.sin(X[:, 0])
    >>> start = ElmRegressor(30, random_state=0).prepare(X[::5], y[::5])
    >>> workers = [copy.deepcopy(start).partial_fit(X[i::4], y[i::4]) for i in range(4)]
    >>> round(merge(workers).score(X, y), 3)
    1.0
    """
    models = list(models)
    if not models:
        raise ValueError("merge needs at least one model")
    whole = copy.deepcopy(models[0])
    own = whole._pieces()
    for model in models[1:]:
        if type(model) is not type(whole):
            raise TypeError(f"cannot merge {type(model).__name__} into {type(whole).__name__}")
        if not np.array_equal(getattr(model, "classes_", None), getattr(whole, "classes_", None)):
            raise ValueError("models of different classes cannot be merged")
        own.merge(model._pieces(), whole._threads())
    whole._network = None
    return whole


class ElmBase(BaseEstimator):
    """Parameters and files of the estimators."""

    def _settings(self, partial: bool = False) -> Settings:
        neurons = self.n_neurons
        if neurons == "auto":
            for name, given, free in (
                ("activation", self.activation, "tanh"),
                ("scale", self.scale, "auto"),
                ("direct_links", self.direct_links, False),
            ):
                if given != free and not partial:
                    raise ValueError(
                        f"{name}={given!r} and n_neurons='auto', which chooses it, exclude each "
                        "other: give a number of neurons"
                    )
            neurons = PARTIAL_NEURONS if partial else None
        elif not isinstance(neurons, Integral) or isinstance(neurons, bool) or neurons < 1:
            raise ValueError(f"n_neurons must be 'auto' or at least 1, got {neurons!r}")
        if self.scale == "auto":
            scale = 1.0
        elif self.scale == "loo":
            scale = 1.0 if partial else None
        elif isinstance(self.scale, Real) and self.scale > 0:
            scale = float(self.scale)
        else:
            raise ValueError(f"scale must be 'auto', 'loo' or positive, got {self.scale!r}")
        if self.alpha in ("loo", "gcv"):
            alpha = self.alpha
        elif isinstance(self.alpha, Real) and self.alpha > 0:
            alpha = repr(float(self.alpha))
        else:
            raise ValueError(f"alpha must be 'loo', 'gcv' or positive, got {self.alpha!r}")
        seed = self.random_state
        if not isinstance(seed, Integral):
            seed = check_random_state(seed).randint(2**31)
        neurons = None if neurons is None else int(neurons)
        links, threads = bool(self.direct_links), self._threads()
        return Settings(neurons, self.activation, scale, alpha, links, int(seed), threads)

    def _threads(self) -> int:
        jobs = 1 if self.n_jobs is None else int(self.n_jobs)
        if jobs == 0:
            raise ValueError("n_jobs == 0 has no meaning")
        if jobs > 0:
            return jobs
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        return max(1, (cores or 1) + 1 + jobs)

    def _inputs(self, X):
        """Inputs to predict for, of the type of the model."""
        check_is_fitted(self)
        return validate_data(self, X, reset=False, dtype=self._fitted().dtype)

    def _fitted(self):
        """The fitted network; after ``partial_fit`` it is solved for when it is first needed."""
        if self._network is None:
            self._network = self._rows.fit(self._threads())
        return self._network

    def _begin(self, rows):
        """Start on rows in pieces."""
        self._rows = rows
        self._network = None
        self._importances = None

    def _pieces(self):
        """What rows in pieces have left."""
        check_is_fitted(self)
        if self._rows is None:
            raise ValueError(
                f"this {type(self).__name__} was fitted by fit, which keeps no rows to add to: "
                "begin with prepare or partial_fit"
            )
        return self._rows

    def compact(self):
        """Make a pickle of a model in pieces small: at most half the square of neurons and outputs in numbers.

        Returns
        -------
        self : estimator
        """
        self._pieces().compact(self._threads())
        return self

    def forget(self, factor):
        """Let all rows so far count less, for what drifts.

        Parameters
        ----------
        factor : float
            What their weights are multiplied by, from 0 to 1.

        Returns
        -------
        self : estimator
        """
        self._pieces().forget(float(factor))
        self._network = None
        return self

    @property
    def n_rows_(self) -> int:
        """Rows that ``partial_fit`` has taken in, those of merged models included."""
        check_is_fitted(self)
        if self._rows is None:
            raise AttributeError("n_rows_ is known after prepare or partial_fit")
        return self._rows.rows

    @staticmethod
    def _weights(X, sample_weight):
        """Weights of rows of the type of the inputs, or None."""
        if sample_weight is None:
            return None
        return _check_sample_weight(sample_weight, X, dtype=X.dtype, ensure_non_negative=True)

    def _arranged(self, X, *columns):
        """The rows in the order of their values, where settings are searched for on all of them.

        The search lays neurons on rows that it draws by index; how rows are arranged is to make no difference.
        """
        if self.n_neurons != "auto" or X.shape[0] > SEARCH_ROWS:
            return (X, *columns)
        order = np.lexsort(X.T[::-1])
        return (X[order], *(None if column is None else column[order] for column in columns))

    def _work(self, X) -> float:
        if self.n_neurons == "auto" or self.scale == "loo":
            return float("inf")
        return X.shape[0] * float(self.n_neurons) ** 2

    def _describe(self, network) -> None:
        """What a fit found, as attributes."""
        self.n_neurons_ = network.neurons
        self.alpha_ = np.asarray(network.alpha)
        left_out = network.leave_one_out
        self.loo_rmse_ = None if left_out is None else np.asarray(left_out)

    @property
    def feature_importances_(self):
        """Scales of the inputs, ramps along them included, that ``n_neurons="auto"`` chose, 1 in sum.

        For a model of given settings take ``permutation_importance`` of :class:`ElmRegressor` or of
        :mod:`sklearn.inspection`.

        Returns
        -------
        ndarray of shape (n_features,)
        """
        check_is_fitted(self)
        if self._importances is None:
            raise AttributeError(
                "feature_importances_ are known where n_neurons='auto' has chosen scales of inputs; "
                "take permutation_importance"
            )
        return self._importances

    def _set_importances(self, network) -> None:
        self._importances = None
        if self.n_neurons == "auto":
            scales = np.asarray(network.relevance)
            self._importances = scales / scales.sum()

    def to_onnx(self, path, double: bool = False) -> None:
        """Write the model as an ONNX graph.

        Parameters
        ----------
        path : path-like
            The file. A regressor has the output ``y`` of shape (rows, outputs), a classifier ``label``, the
            index of the class in ``classes_``, and ``probabilities`` of shape (rows, classes).
        double : bool, default=False
            Whether inputs and outputs are float64, else float32. All between is float64.
        """
        check_is_fitted(self)
        graph = self._fitted().to_onnx(double)
        with open(path, "wb") as file:
            file.write(graph)

    def __getstate__(self):
        state = dict(super().__getstate__())
        for name in ("_network", "_rows"):
            if state.get(name) is not None:
                state[name] = state[name].to_bytes()
        return state

    def __setstate__(self, state):
        state = dict(state)
        for name, kind in (("_network", self._NETWORK), ("_rows", self._ROWS)):
            if state.get(name) is not None:
                state[name] = kind.from_bytes(state[name])
        super().__setstate__(state)


def interruptible(work: float, function, *arguments):
    """Call a function that does not run Python code; Ctrl-C ends the wait for a long one.

    The thread behind an interrupted call ends by itself when its fit is done; its result is dropped.
    """
    if work < LONG or threading.current_thread() is not threading.main_thread():
        return function(*arguments)
    outcome = []

    def run():
        try:
            outcome.append((function(*arguments), None))
        except BaseException as error:  # passed on below
            outcome.append((None, error))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(0.05)
    result, error = outcome[0]
    if error is not None:
        raise error
    return result

"""Extreme learning machines: a layer of random neurons and one linear solve, in Rust.

>>> from elm_learn import ElmRegressor
>>> model = ElmRegressor(random_state=0).fit([[0.0], [1.0], [2.0], [3.0]], [0.0, 1.0, 4.0, 9.0])
>>> model.predict([[1.0]]).shape
(1,)
"""

from importlib.metadata import version as _version

from . import brdf
from ._base import merge
from ._classifier import ElmClassifier
from ._regressor import ElmRegressor

__version__ = _version("elm-learn")
__all__ = ["ElmClassifier", "ElmRegressor", "brdf", "merge"]

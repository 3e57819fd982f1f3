"""Reflectance models (BRDF): files of ``elm-brdf``, and fits.

Directions are unit vectors in the frame of the surface, whose normal is (0, 0, 1), both pointing away from it;
values are in 1/sr, without the cosine.

>>> from elm_learn import brdf
>>> paint = brdf.load("paint.elm")  # doctest: +SKIP
>>> paint.eval([[0.6, 0.0, 0.8]], [[0.0, 0.0, 1.0]])  # doctest: +SKIP
"""

from __future__ import annotations

import numpy as np

from ._elm_learn import Brdf as _Brdf

__all__ = ["Brdf", "fit", "load"]


def _directions(name, w):
    w = np.asarray(w, dtype=np.float64)
    if w.ndim == 0 or w.shape[-1] != 3:
        raise ValueError(f"{name} must have shape (..., 3), got {w.shape}")
    return w


def _pairs(wi, wo):
    """Both directions broadcast against each other, shapes (n, 3), and the shape of the pairs."""
    wi, wo = np.broadcast_arrays(_directions("wi", wi), _directions("wo", wo))
    return wi.reshape(-1, 3), wo.reshape(-1, 3), wi.shape[:-1]


class Brdf:
    """A reflectance model; made by :func:`load` and :func:`fit`."""

    def __init__(self, model):
        self._model = model

    def eval(self, wi, wo):
        """Values for pairs of directions, which are broadcast against each other.

        Parameters
        ----------
        wi, wo : array-like of shape (..., 3)
            Towards the light, towards the viewer; made unit vectors.

        Returns
        -------
        values : ndarray of shape (..., channels)
            In 1/sr; 0 below the horizon.
        """
        wi, wo, shape = _pairs(wi, wo)
        values = self._model.eval(wi, wo)
        return values.reshape(*shape, -1)

    def sample(self, wo, u):
        """Draw directions towards the light, about in proportion to the value times the cosine.

        Parameters
        ----------
        wo : array-like of shape (..., 3)
            Towards the viewer; made unit vectors.
        u : array-like of shape (..., 2)
            Uniform numbers from 0 to 1, broadcast against ``wo``.

        Returns
        -------
        wi : ndarray of shape (..., 3)
        pdf : ndarray of shape (...)
            Their densities in 1/sr; 0 where there is nothing to draw.
        """
        wo, u = _directions("wo", wo), np.asarray(u, dtype=np.float64)
        if u.ndim == 0 or u.shape[-1] != 2:
            raise ValueError(f"u must have shape (..., 2), got {u.shape}")
        shape = np.broadcast_shapes(wo.shape[:-1], u.shape[:-1])
        wo, u = np.broadcast_to(wo, (*shape, 3)), np.broadcast_to(u, (*shape, 2))
        wi, pdf = self._model.sample(wo.reshape(-1, 3), u.reshape(-1, 2))
        return wi.reshape(*shape, 3), pdf.reshape(shape)

    def pdf(self, wi, wo):
        """The density with which :meth:`sample` draws ``wi``.

        Parameters
        ----------
        wi, wo : array-like of shape (..., 3)
            Towards the light, towards the viewer; made unit vectors.

        Returns
        -------
        ndarray of shape (...)
            In 1/sr.
        """
        wi, wo, shape = _pairs(wi, wo)
        return self._model.pdf(wi, wo).reshape(shape)

    def save(self, path):
        """Write a file that ``elm-brdf`` and :func:`load` read; JSON where the name ends in ``.json``."""
        self._model.save(path)

    def to_onnx(self, path, double=False):
        """Write the model as an ONNX graph.

        Parameters
        ----------
        path : path-like
            The file. Inputs are ``light`` and ``viewer`` of shape (rows, 3), made unit vectors; the output is
            ``values`` of shape (rows, channels).
        double : bool, default=False
            Whether inputs and outputs are float64, else float32. All between is float64.
        """
        graph = self._model.to_onnx(double)
        with open(path, "wb") as file:
            file.write(graph)

    @property
    def channels(self):
        """Names of the channels."""
        return self._model.channels

    @property
    def is_isotropic(self):
        """Whether turning the surface about its normal changes nothing."""
        return self._model.is_isotropic


def load(path) -> Brdf:
    """Read a model.

    Parameters
    ----------
    path : path-like
        A file that ``elm-brdf fit`` or :meth:`Brdf.save` wrote.

    Returns
    -------
    Brdf
    """
    return Brdf(_Brdf.load(path))


def fit(wi, wo, values, n_neurons=None) -> Brdf:
    """Fit a model to measurements; all that is not said is chosen by held-out errors.

    Parameters
    ----------
    wi, wo : array-like of shape (n, 3)
        Towards the light, towards the viewer.
    values : array-like of shape (n,) or (n, channels)
        Measured values in 1/sr.
    n_neurons : int, default=None
        Number of neurons.

    Returns
    -------
    Brdf
    """
    values = np.asarray(values, dtype=np.float64)
    values = values[:, None] if values.ndim == 1 else values
    wi, wo = _directions("wi", wi), _directions("wo", wo)
    return Brdf(_Brdf.fit(wi, wo, values, n_neurons))

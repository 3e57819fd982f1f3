"""Reflectance models."""

import numpy as np
import pytest

from elm_learn import brdf


def directions(count, seed):
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.1
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def test_a_diffuse_surface_is_fitted_saved_and_loaded(tmp_path):
    wi, wo = directions(300, 0), directions(300, 1)
    values = np.full((300, 3), [0.1, 0.2, 0.3]) / np.pi
    model = brdf.fit(wi, wo, values, n_neurons=10)
    new = model.eval(directions(50, 2)[:, None], directions(40, 3))
    assert new.shape == (50, 40, 3)
    np.testing.assert_allclose(new, np.broadcast_to(values[0], new.shape), rtol=1e-2)
    model.save(tmp_path / "matte.elm")
    again = brdf.load(tmp_path / "matte.elm")
    np.testing.assert_array_equal(again.eval(wi, wo), model.eval(wi, wo))
    assert again.eval([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]).tolist() == [0.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="shape"):
        model.eval(wi[:, :2], wo)
    (tmp_path / "bad.elm").write_bytes(b"elmfile\n")
    with pytest.raises(ValueError, match="cut short"):
        brdf.load(tmp_path / "bad.elm")

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


def test_samples_have_the_density_that_pdf_gives_and_its_integral_is_one():
    wi, wo = directions(400, 4), directions(400, 5)
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    values = 0.1 + 2 * np.exp((half[:, 2] - 1) / 0.02)
    model = brdf.fit(wi, wo, values, n_neurons=60)
    viewer = np.array([0.6, 0.0, 0.8])
    u = np.random.default_rng(6).random((20_000, 2))
    drawn, density = model.sample(viewer, u)
    assert drawn.shape == (20_000, 3) and density.shape == (20_000,)
    kept = density > 0
    np.testing.assert_allclose(model.pdf(drawn[kept], viewer), density[kept], rtol=1e-9)
    # Uniform directions of the hemisphere have the density 1 / 2 pi.
    z, angle = u[:, 0], 2 * np.pi * u[:, 1]
    r = np.sqrt(1 - z**2)
    uniform = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    assert abs(2 * np.pi * model.pdf(uniform, viewer).mean() - 1) < 0.05
    # Both estimate the albedo at this viewer.
    by_lobes = (model.eval(drawn[kept], viewer)[:, 0] * drawn[kept, 2] / density[kept]).sum() / len(u)
    by_uniform = (model.eval(uniform, viewer)[:, 0] * z).mean() * 2 * np.pi
    np.testing.assert_allclose(by_lobes, by_uniform, rtol=0.05)
    with pytest.raises(ValueError, match="u must have shape"):
        model.sample(viewer, u[:, :1])

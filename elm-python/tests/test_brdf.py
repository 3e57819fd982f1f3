"""Reflectance models."""

import json

import numpy as np
import onnxruntime
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


def highlight(wi, wo, roughness):
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    return np.exp(-(half[:, 0] ** 2 / roughness[0] + half[:, 1] ** 2 / roughness[1]) / half[:, 2] ** 2)


def materials():
    wi, wo = directions(600, 7), directions(600, 8)
    noise = 1 + 0.01 * np.random.default_rng(9).normal(size=(600, 1))
    one = 0.1 + 2 * highlight(wi, wo, (0.1, 0.1))[:, None]
    yield "one channel", wi, wo, one
    yield "not reciprocal", wi, wo, one * (1 + 0.5 * wi[:, 2:]) * noise
    yield "a grain", wi, wo, 0.1 + 2 * highlight(wi, wo, (0.02, 0.2))[:, None] * np.ones(3)
    yield "many channels", wi, wo, one * np.linspace(0.5, 1.5, 8) + 0.1 * wi[:, 2:] * np.linspace(0, 1, 8) ** 2


def evaluated(path, wi, wo):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    kind = np.float64 if "double" in session.get_inputs()[0].type else np.float32
    (values,) = session.run(["values"], {"light": wi.astype(kind), "viewer": wo.astype(kind)})
    return values, session.get_modelmeta().custom_metadata_map


def test_onnx_graphs_have_the_values_of_the_model(tmp_path):
    wi, wo = directions(10_000, 10), directions(10_000, 11)
    # Below the horizon, at it, both directions one, a mirror's, along the normal.
    n = np.array([0.0, 0.0, 1.0])
    wi[:5] = [-n, [1, 0, 0], wi[2], wi[3], n]
    wo[2:5] = [wi[2], wi[3] * [-1, -1, 1], n]
    kinds = set()
    for name, *fitted_to in materials():
        model = brdf.fit(*fitted_to, n_neurons=40)
        kinds.add(model.is_isotropic)
        model.save(tmp_path / "model.json")
        contents = json.loads((tmp_path / "model.json").read_text())["contents"]
        kinds.add(json.dumps(contents["features"]))
        values = model.eval(wi, wo)
        # Sines of arguments of a few units and their sum are rounded in another order: to some epsilon of the
        # sum of all weights. Values are exponentials, and off by that share.
        weights = np.abs(contents["beta"]["data"]).sum() + np.abs(contents["intercept"]["data"]).sum()
        rounding = 8 * np.finfo(float).eps * weights
        for double, tolerance in ((True, rounding), (False, 1e-6)):
            model.to_onnx(tmp_path / "model.onnx", double=double)
            found, about = evaluated(tmp_path / "model.onnx", wi, wo)
            if not double:
                values = model.eval(wi.astype(np.float32), wo.astype(np.float32))
            assert np.abs(found - values).max() <= tolerance * values.max(), (name, double)
            assert (found[:2] == 0).all()
            assert about["channels"] == ""
    # Reciprocal, not reciprocal, with a grain.
    assert True in kinds and False in kinds and len(kinds) >= 4, kinds

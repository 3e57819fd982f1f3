"""Checks the RGL reader against the authors' own renderer, on a file made from formulas.

    python3 -m venv venv && venv/bin/pip install numpy mitsuba
    venv/bin/python benches/peers/rgl_mitsuba.py elm-datasets/tests/data

writes `mitsuba-rgb.bsdf` and `mitsuba-spectral.bsdf`, isotropic materials without any symmetry that
a mistake could hide behind, and beside each a `.csv` with its BRDF as Mitsuba's plugin `measured`
evaluates it. The test `the_authors_renderer_gives_the_same_values` in elm-datasets/tests/rgl.rs
reads them. Written with Mitsuba 3.9.1; the same numbers each time.
"""

import pathlib
import struct
import sys

import mitsuba as mi
import numpy as np

WAVELENGTHS = [400.0, 500.0, 600.0, 700.0]


def square(width, height, function):
    """A table over the unit square, the first coordinate along rows."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    return function(x, y)


def fields(values, channels):
    theta_i = np.array([0.1, 0.5, 0.9, 1.3])
    vndf, tables = [], []
    for k, theta in enumerate(theta_i):
        # Densities over the square of the half vector: a bump that moves with the light. The
        # first and the last row are the same azimuth.
        vndf.append(
            square(9, 8, lambda x, y: 0.2 + x * np.exp(-6 * (x - 0.3 - 0.1 * k) ** 2)
                   * (1.5 + np.cos(2 * np.pi * y)))
        )
        for c in range(channels):
            tables.append(square(6, 6, lambda x, y: 0.05 + 0.1 * c + 0.2 * x * (1 + theta)
                              + 0.3 * y * y + 0.1 * np.sin(5 * x * y + c + k)))
    tables = np.array(tables).reshape(1, len(theta_i), channels, 6, 6)
    return {
        "description": np.frombuffer(b"made from formulas", dtype=np.uint8),
        "phi_i": np.array([0.0]),
        "theta_i": theta_i,
        "ndf": square(10, 7, lambda x, y: 2.0 * np.exp(-5 * x * x) + 0.1 + 0.05 * np.cos(2 * np.pi * y)),
        # Without a grain the facets' area cannot depend on the azimuth. The plugin counts on it: it
        # may turn light and viewer by half a turn before it looks the area up.
        "sigma": square(5, 4, lambda x, y: 0.4 + 0.3 * x),
        "vndf": np.array(vndf).reshape(1, len(theta_i), 8, 9),
        "luminance": tables.mean(axis=2),
        values: tables,
        "jacobian": np.array([1], dtype=np.uint8),
    }


def tensor_file(fields):
    fields = {k: v if v.dtype == np.uint8 else v.astype(np.float32) for k, v in fields.items()}
    offset = 18 + sum(2 + len(k) + 2 + 1 + 8 + 8 * v.ndim for k, v in fields.items())
    out = b"tensor_file\0\x01\x00" + struct.pack("<I", len(fields))
    for name, values in fields.items():
        out += struct.pack("<H", len(name)) + name.encode()
        out += struct.pack("<HBQ", values.ndim, 1 if values.dtype == np.uint8 else 10, offset)
        out += struct.pack(f"<{values.ndim}Q", *values.shape)
        offset += values.nbytes
    return out + b"".join(values.tobytes() for values in fields.values())


def write(folder, name, variant, channels, fields):
    mi.set_variant(variant)
    path = folder / f"mitsuba-{name}.bsdf"
    path.write_bytes(tensor_file(fields))
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    random = np.random.default_rng(1)
    lines = [",".join(["theta_i,phi_i,theta_o,phi_o", *channels])]
    context = mi.BSDFContext()
    for _ in range(200):
        theta = np.arccos(random.uniform(0.05, 1.0, 2))
        phi = random.uniform(-np.pi, np.pi, 2)
        wi, wo = (
            mi.Vector3f(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t))
            for t, p in zip(theta, phi)
        )
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = wi
        if variant == "scalar_spectral":
            interaction.wavelengths = WAVELENGTHS
        # The plugin returns the BRDF times the cosine of its omega_o.
        value = np.array(bsdf.eval(context, interaction, wo)) / np.cos(theta[1])
        numbers = [theta[0], phi[0], theta[1], phi[1], *value]
        lines.append(",".join(f"{number:.8g}" for number in numbers))
    path.with_suffix(".csv").write_text("\n".join(lines) + "\n")


def main(folder):
    folder = pathlib.Path(folder)
    write(folder, "rgb", "scalar_rgb", ["red", "green", "blue"], fields("rgb", 3))
    spectral = fields("spectra", len(WAVELENGTHS)) | {"wavelengths": np.array(WAVELENGTHS)}
    names = [f"{wavelength:g} nm" for wavelength in WAVELENGTHS]
    write(folder, "spectral", "scalar_spectral", names, spectral)


if __name__ == "__main__":
    main(*sys.argv[1:])

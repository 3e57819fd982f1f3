"""Holds exported materials against their models in Mitsuba: values, chi-square tests, furnaces, spheres.

    python mitsuba_check.py FOLDER NAME...

FOLDER has of each material NAME.bsdf, NAME.py and NAME.csv: unit vectors of light and viewer, and the model's red,
green and blue. Prints a line of JSON for each figure.
"""

import importlib
import json
import pathlib
import sys

import mitsuba as mi
import numpy as np

mi.set_variant('llvm_ad_rgb')
import drjit as dr
from mitsuba.python.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

ANGLES = (0, 20, 40, 60, 75)


def say(**figures):
    print(json.dumps(figures), flush=True)


def values(bsdf, wi, wo):
    """BRDF in 1/sr."""
    si = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    si.wi = mi.Vector3f(wi.T)
    found = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo.T)))
    return found.T / wo[:, 2:]


class Turned(SphericalDomain):
    """The sphere with its pole in the surface, for highlights around the normal: next to the pole a step of an integral
    is 2 degrees wide, and a highlight may be narrower."""

    def map_forward(self, p):
        d = super().map_forward(p)
        return mi.Vector3f(d.y, d.z, d.x)

    def map_backward(self, p):
        return super().map_backward(mi.Vector3f(p.z, p.x, p.y))


def chi_square(material, what, description):
    for angle in ANGLES:
        theta, phi = np.radians(angle), 0.3
        wi = [float(np.sin(theta) * np.cos(phi)), float(np.sin(theta) * np.sin(phi)), float(np.cos(theta))]
        sample, pdf = BSDFAdapter(description['type'], description, wi=wi)
        domain = Turned() if angle == 0 else SphericalDomain()
        # Highlights narrower than a bin ask for finer integrals.
        test = ChiSquareTest(domain, sample, pdf, sample_dim=3, ires=32, res=101)
        passed = test.run(significance_level=0.01, test_count=len(ANGLES), quiet=True)
        say(material=material, what=f'{what} chi-square', angle=angle, passed=bool(passed), p=float(test.p_value),
            pdf=float(dr.sum(test.pdf)[0] if dr.is_array_v(dr.sum(test.pdf)) else dr.sum(test.pdf)) / test.sample_count)


def sphere(bsdf, emitter, spp, width=96):
    return mi.load_dict({
        'type': 'scene',
        'integrator': {'type': 'path', 'max_depth': 2},
        'sensor': {
            'type': 'orthographic',
            'to_world': mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
            'film': {'type': 'hdrfilm', 'width': width, 'height': width, 'rfilter': {'type': 'box'}},
            'sampler': {'type': 'independent', 'sample_count': spp},
        },
        'sphere': {'type': 'sphere', 'bsdf': bsdf},
        'emitter': emitter,
    })


def furnace(material, what, bsdf):
    """Directions drawn by the material alone: fireflies are large values, black specks small ones."""
    scene = sphere(bsdf, {'type': 'constant', 'radiance': 1.0}, 256)
    # Emitters are not sampled, so that all noise is the material's.
    integrator = mi.load_dict({'type': 'path', 'max_depth': 2, 'hide_emitters': True})
    picture = np.array(mi.render(scene, integrator=integrator, spp=256))[..., :3].mean(-1)
    n = picture.shape[0]
    centre = (np.arange(n) + 0.5) * 2 / n - 1
    # Off the outermost ring, which sees the environment, too.
    radius = np.hypot(*np.meshgrid(centre, centre))
    inner = radius < 0.97
    # Two pixels wide: the albedo changes along the radius, too.
    ends = np.linspace(0, 0.97, 25)
    rings = list(zip(ends, ends[1:]))
    largest, least = 0.0, np.inf
    for a, b in rings:
        ring = picture[(radius >= a) & (radius < b)]
        mean = np.median(ring)
        largest, least = max(largest, float(ring.max() / mean)), min(least, float(ring.min() / mean))
    say(material=material, what=f'{what} furnace', mean=float(picture[inner].mean()), largest=largest, least=least)


def picture(path):
    return np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))


def lit_spheres(folder, material, descriptions):
    """Against the picture NAME_sphere.exr: NAME_ours.exr, and one evaluation at the centre of each pixel."""
    path = folder / f'{material}_sphere.exr'
    if not path.exists():
        return
    reference = picture(path)
    n = reference.shape[0]
    centre = (np.arange(n) + 0.5) * 2 / n - 1
    x, y = np.meshgrid(centre, -centre)
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    inside = x * x + y * y < 1
    normal = np.stack([x, y, z], -1)[inside].astype(np.float32)
    frame = mi.Frame3f(mi.Normal3f(normal.T))
    si = dr.zeros(mi.SurfaceInteraction3f, len(normal))
    si.wi = frame.to_local(mi.Vector3f(0, 0, 1))
    wo = frame.to_local(dr.normalize(mi.Vector3f(-1, 1, 1)))
    pictures = {'renderer': picture(folder / f'{material}_ours.exr')}
    for what, bsdf in descriptions:
        pictures[what] = np.zeros_like(reference)
        pictures[what][inside] = np.array(load(bsdf).eval(mi.BSDFContext(), si, wo)).T
    luminance = reference @ np.array([0.2126, 0.7152, 0.0722])
    scale = 0.8 / np.percentile(luminance[luminance > 0], 95)
    srgb = lambda v: np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 1e-9) ** (1 / 2.4) - 0.055)
    for what, found in pictures.items():
        difference = srgb(np.clip(scale * found, 0, 1)) - srgb(np.clip(scale * reference, 0, 1))
        say(material=material, what=f'{what} sphere', psnr=float(-10 * np.log10((difference[inside] ** 2).mean())))


def load(description):
    return mi.load_dict(description)


def main(folder, names):
    folder = pathlib.Path(folder)
    sys.path.insert(0, str(folder))
    for name in names:
        rows = np.loadtxt(folder / f'{name}.csv', delimiter=',', dtype=np.float32)
        light, viewer, expected = rows[:, :3], rows[:, 3:6], rows[:, 6:]
        importlib.import_module(name)
        file = {'type': 'measured', 'filename': str(folder / f'{name}.bsdf')}
        plugin = {'type': name}
        # A file's omega_i is the light, the plug-in's si.wi the viewer.
        found = values(load(file), light, viewer)
        difference = np.abs(np.log1p(found * viewer[:, 2:]) - np.log1p(expected * viewer[:, 2:])).mean()
        say(material=name, what='measured values', log_cosine=float(difference), rows=len(rows))
        for what, double in (('elm values', {}), ('elm values, single', {'double': False})):
            found = values(load({**plugin, **double}), viewer, light)
            relative = np.abs(found - expected) / (expected + 1e-3)
            say(material=name, what=what, relative=float(relative.max()), mean=float(relative.mean()),
                rms=float(np.sqrt(np.square(found - expected).mean() / np.square(expected).mean())))
        descriptions = (('measured', file), ('elm', plugin))
        for what, bsdf in descriptions:
            chi_square(name, what, bsdf)
            furnace(name, what, bsdf)
        lit_spheres(folder, name, descriptions)


if __name__ == '__main__':
    main(sys.argv[1], sys.argv[2:])

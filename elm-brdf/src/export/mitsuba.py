"""@ABOUT@

A measured material for Mitsuba 3.7 or later, learnt by an extreme learning machine. The network, its
weights and its sampler are all in this file:

    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    import @MODULE@  # registers '@NAME@' in this variant and in each that is set later
    scene = mi.load_dict({'type': 'scene', ..., 'sphere': {'type': 'sphere', 'bsdf': {'type': '@NAME@'}}})

It runs in every variant that knows no polarisation. Scalar variants interpret it neuron by neuron: use an LLVM
or CUDA variant for pictures. The network is evaluated in double precision, on CUDA in single; 'double': True or False
beside 'type' says otherwise. In single precision weights that nearly cancel cost digits: values err by some @SINGLE@
of their root mean square. si.wi is the viewer and wo the light, as in a path that begins at the camera; the
surface is black from below: wrap it in 'twosided' for both sides. @GRAIN@Values are those of
the model, in 1/sr, and times the cosine of wo, as Mitsuba has it. mi.traverse(bsdf) lists the weights, which
are differentiable: 'neurons' (a row for each: @ROW@),
'linear' (weights of the inputs themselves, by output) and 'constant' (by output). The sampler stays as it was
fitted.
"""

import drjit as dr
import mitsuba as mi

NAME = '@NAME@'
# Outputs: 'rgb' or the wavelengths of a spectrum in nm.
CHANNELS = @CHANNELS@
INPUTS = @COUNT@
# Function, first and last neuron and, of distances, weights of the inputs.
GROUPS = @GROUPS@
NEURONS = @NEURONS@
LINEAR = @LINEAR@
CONSTANT = @CONSTANT@
# From outputs to values: kind, offset, ceiling.
TARGETS = @TARGETS@
# The sampler's lobes: kind, parameters, weights of Bernstein's polynomials in the viewer's cosine.
LOBES = @LOBES@
# Red, green and blue as spectra that add up to 1, at these wavelengths in nm.
PRIMARIES = @PRIMARIES@

ACTIVATIONS = {
    'sigmoid': lambda z: 1 / (1 + dr.exp(-z)),
    'tanh': lambda z: 1 - 2 / (dr.exp(2 * z) + 1),
    'sine': lambda z: dr.sin(z),
    'gaussian': lambda z: dr.exp(-z * z),
    'relu': lambda z: dr.maximum(z, 0),
    'squared-relu': lambda z: dr.square(dr.maximum(z, 0)),
    'hard-limit': lambda z: dr.select(z >= 0, 1.0, 0.0),
    'isru': lambda z: z * dr.rsqrt(1 + z * z),
    'linear': lambda z: z,
}


def inputs(light, viewer):
    """What the network takes, of unit vectors in the frame of the surface."""
    ix, iy, iz = light.x, light.y, light.z
    ox, oy, oz = viewer.x, viewer.y, viewer.z
@LOCALS@
    return [@INPUTS@]


def interpolated(wavelength, at, values):
    """A piecewise linear function of the wavelength, constant beyond its ends."""
    result = wavelength * 0 + values[0]
    for a, b, u, v in zip(at, at[1:], values, values[1:]):
        result += (v - u) * dr.clip((wavelength - a) / (b - a), 0, 1)
    return result


def to_rgb(values):
    """Three channels as they are, one as grey, a spectrum as linear sRGB under D65."""
    if CHANNELS == 'rgb':
        return values if len(values) == 3 else values * 3
    global RGB_OF_SPECTRUM
    if RGB_OF_SPECTRUM is None:
        RGB_OF_SPECTRUM = rgb_of_spectrum()
    return [sum(w * v for w, v in zip(row, values)) for row in RGB_OF_SPECTRUM]


RGB_OF_SPECTRUM = None


def rgb_of_spectrum():
    """What each channel of a spectrum adds to red, green and blue."""
    total = [0.0] * 3
    rows = [[0.0] * len(CHANNELS) for _ in range(3)]
    scalar = lambda value: float(value[0]) if dr.is_array_v(value) else float(value)
    for nm in range(360, 831, 2):
        wavelength = mi.Float(nm)
        xyz = [scalar(c) * scalar(mi.cie_d65(wavelength)) for c in mi.cie1931_xyz(wavelength)]
        matrix = ((3.240479, -1.537150, -0.498535), (-0.969256, 1.875991, 0.041556), (0.055648, -0.204043, 1.057311))
        for c in range(3):
            part = sum(m * v for m, v in zip(matrix[c], xyz))
            total[c] += part
            for k in range(len(CHANNELS)):
                unit = [float(j == k) for j in range(len(CHANNELS))]
                rows[c][k] += part * interpolated(float(nm), CHANNELS, unit)
    return [[value / total[c] for value in rows[c]] for c in range(3)]


def turned(x, y, sin, cos):
    return cos * x - sin * y, sin * x + cos * y


def density_of(kind, p, light, viewer):
    """The density of a lobe per steradian, light and viewer above the horizon."""
    ix, iy, iz = light.x, light.y, light.z
    ox, oy, oz = viewer.x, viewer.y, viewer.z
    if kind == 'cosine':
        return iz * dr.inv_pi
    if kind == 'uniform':
        return iz * 0 + dr.inv_two_pi
    if kind == 'tilted':
        moved = p[0] * p[0] * (ox * ox + oy * oy)
        ratio = (1 - moved) / (1 + 2 * p[0] * (ox * ix + oy * iy) + moved * (ix * ix + iy * iy))
        return iz * dr.inv_pi * ratio * ratio
    if kind == 'ggx':
        a, b, sin, cos = p
        px, py = turned(ox, oy, -sin, cos)
        lx, ly = turned(ix, iy, -sin, cos)
        sx, sy = dr.square(px + lx), dr.square(py + ly)
        stretched = sx / (a * a) + sy / (b * b)
        up, down = dr.square(oz + iz), dr.square(dr.maximum(oz - iz, 0))
        above = (sx + sy + up) / (stretched + up)
        below = dr.select(down > 0, (sx + sy + down) / dr.maximum(stretched + down, 1e-30), 0)
        visible = oz + dr.sqrt(dr.square(a * px) + dr.square(b * py) + oz * oz)
        return (above * above + below * below) / (dr.two_pi * a * b * visible)
    s, retro = 0.5 * p[0] * p[0], p[1]
    sign = -1 if retro else 1
    flat = s + 0.5 * (dr.square(ix + sign * ox) + dr.square(iy + sign * oy))
    up, down = flat + 0.5 * dr.square(iz - oz), flat + 0.5 * dr.square(iz + oz)
    return s * (s + 2) / (2 * dr.two_pi) * (1 / (up * up) + 1 / (down * down))


def draw(kind, p, viewer, u, v):
    """A direction of a lobe; what falls below the horizon is reflected upwards by the caller."""
    ox, oy, oz = viewer.x, viewer.y, viewer.z
    sa, ca = dr.sincos(dr.two_pi * u)
    if kind == 'cosine':
        r = dr.sqrt(v)
        return r * ca, r * sa, dr.safe_sqrt(1 - v)
    if kind == 'uniform':
        r = dr.safe_sqrt(v * (2 - v))
        return r * ca, r * sa, 1 - v
    if kind == 'tilted':
        wx, wy = -p[0] * ox, -p[0] * oy
        zx, zy = dr.sqrt(v) * ca, dr.sqrt(v) * sa
        ax, ay = zx + wx, zy + wy
        bx, by = 1 + wx * zx + wy * zy, wx * zy - wy * zx
        size = bx * bx + by * by
        x, y = (ax * bx + ay * by) / size, (ay * bx - ax * by) / size
        # 1 - x^2 - y^2, which would be lost next to the horizon.
        return x, y, dr.safe_sqrt((1 - wx * wx - wy * wy) * (1 - v) / size)
    if kind == 'ggx':
        a, b, sin, cos = p
        px, py = turned(ox, oy, -sin, cos)
        q = dr.rsqrt(dr.square(a * px) + dr.square(b * py) + oz * oz)
        cap = 1 + oz * q
        h = v * cap
        r = dr.safe_sqrt(h * (2 - h))
        mx, my, mz = a * (r * ca + a * px * q), b * (r * sa + b * py * q), (1 - v) * cap
        along = 2 * (px * mx + py * my + oz * mz) / dr.maximum(mx * mx + my * my + mz * mz, 1e-30)
        x, y = turned(along * mx - px, along * my - py, sin, cos)
        return x, y, along * mz - oz
    s, retro = 0.5 * p[0] * p[0], p[1]
    sign = 1 if retro else -1
    px, py = sign * ox, sign * oy
    off = 2 * v * s / (s + 2 * (1 - v))
    r = dr.safe_sqrt(off * (2 - off))
    tx, ty = r * ca, r * sa
    cap = 1 - off - (tx * px + ty * py) / (1 + oz)
    return tx + px * cap, ty + py * cap, (1 - off) * oz - tx * px - ty * py


def make():
    """The class of the present variant."""

    class ElmBSDF(mi.BSDF):
        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide@ANISOTROPIC@
            self.m_components = [flags]
            self.m_flags = flags
            self.double = props.get('double', 'cuda' not in mi.variant())
            kind = mi.TensorXd if self.double else mi.TensorXf
            tensor = lambda rows: kind([v for row in rows for v in row], (len(rows), len(rows[0])))
            self.neurons = tensor(NEURONS)
            self.linear = tensor(LINEAR)
            self.constant = tensor([CONSTANT])

        def traverse(self, callback):
            for name in ('neurons', 'linear', 'constant'):
                callback.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys):
            pass

        def values(self, light, viewer):
            """BRDF in 1/sr, by output."""
            number = mi.Float64 if self.double else mi.Float
            if self.double:
                light, viewer = mi.Vector3d(light), mi.Vector3d(viewer)
            x = inputs(light, viewer)
            outputs, stride = len(CONSTANT), INPUTS + 1 + len(CONSTANT)
            table, linear, constant = self.neurons.array, self.linear.array, self.constant.array
            is_jit = dr.is_jit_v(mi.Float)
            read = (lambda array, index: dr.gather(number, array, index)) if is_jit else (lambda array, index: array[index])
            zero = x[0] * 0
            sums = [
                zero + read(constant, c) + sum(x[i] * read(linear, c * INPUTS + i) for i in range(INPUTS))
                for c in range(outputs)
            ]

            def add(k, sums, function, scales):
                row = [read(table, k * stride + j) for j in range(stride)]
                if scales is None:
                    z = row[INPUTS]
                    for i in range(INPUTS):
                        z = z + row[i] * x[i]
                else:
                    z = sum(dr.square(scales[i] * x[i] - row[i]) for i in range(INPUTS))
                    z = dr.sqrt(z)
                h = ACTIVATIONS[function](z)
                return [t + row[INPUTS + 1 + c] * h for c, t in enumerate(sums)]

            for function, first, last, scales in GROUPS:
                if is_jit:
                    body = lambda k, *t: (k + 1, *add(k, t, function, scales))
                    _, *sums = dr.while_loop(
                        (mi.UInt32(first), *sums), lambda k, *t: k < last, body, max_iterations=-1
                    )
                else:
                    for k in range(first, last):
                        sums = add(k, sums, function, scales)
            return [mi.Float(self.value(t, *target)) for t, target in zip(sums, TARGETS)]

        def value(self, t, kind, offset, ceiling):
            if kind == 'log':
                t = offset * (dr.exp(t) - 1)
            elif kind == 'cube-root':
                t = t * t * t
            return dr.clip(t, 0, ceiling)

        def spectrum(self, si, values):
            if mi.is_spectral:
                if CHANNELS != 'rgb':
                    return self.at_wavelengths(si, CHANNELS, values)
                if len(values) == 1:
                    return mi.Spectrum(values[0])
                nm, primaries = PRIMARIES
                return sum(
                    value * self.at_wavelengths(si, nm, primary) for value, primary in zip(values, primaries)
                )
            rgb = to_rgb(values)
            if mi.is_monochromatic:
                return mi.Spectrum(mi.luminance(mi.Color3f(*rgb)))
            return mi.Color3f(*rgb)

        def at_wavelengths(self, si, nm, values):
            found = [interpolated(si.wavelengths[i], nm, values) for i in range(len(si.wavelengths))]
            return mi.Spectrum(*found)

        def shares(self, viewer):
            x = dr.clip(viewer.z, 0, 1)
            y = 1 - x
            terms = y * y * y, 3 * y * y * x, 3 * y * x * x, x * x * x
            return [sum(w * t for w, t in zip(weights, terms)) for _, _, weights in LOBES]

        def density(self, light, viewer):
            shares = self.shares(viewer)
            parts = (density_of(kind, p, light, viewer) for kind, p, _ in LOBES)
            return sum(share * part for share, part in zip(shares, parts))

        def is_lit(self, ctx, light, viewer, active):
            enabled = ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
            return active & enabled & (light.z > 0) & (viewer.z > 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            active = self.is_lit(ctx, wo, si.wi, active)
            return dr.select(active, dr.detach(self.density(wo, si.wi)), 0.0)

        def eval_pdf(self, ctx, si, wo, active=True):
            active = self.is_lit(ctx, wo, si.wi, active)
            value = self.spectrum(si, self.values(wo, si.wi)) * wo.z
            return dr.select(active, value, 0.0), dr.select(active, dr.detach(self.density(wo, si.wi)), 0.0)

        def sample(self, ctx, si, sample1, sample2, active=True):
            viewer = dr.detach(si.wi)
            # The lobe that the first number chooses.
            direction, begin = None, 0
            for (kind, p, _), share in zip(LOBES, self.shares(viewer)):
                drawn = mi.Vector3f(*draw(kind, p, viewer, sample2.x, sample2.y))
                direction = drawn if direction is None else dr.select(sample1 >= begin, drawn, direction)
                begin = begin + share
            light = dr.detach(dr.normalize(mi.Vector3f(direction.x, direction.y, dr.abs(direction.z))))
            value, pdf = self.eval_pdf(ctx, si, light, active)
            active = self.is_lit(ctx, light, si.wi, active) & (pdf > 0)
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo = light
            bs.pdf = pdf
            bs.eta = 1.0
            bs.sampled_type = +mi.BSDFFlags.GlossyReflection
            bs.sampled_component = 0
            # A weight of 0 would say that nothing was drawn, which is not so where the material is black.
            weight = dr.maximum(value / dr.select(active, pdf, 1.0), 1e-30)
            return bs, dr.select(active, weight, 0.0)

        def eval_pdf_sample(self, ctx, si, wo, sample1, sample2, active=True):
            return (*self.eval_pdf(ctx, si, wo, active), *self.sample(ctx, si, sample1, sample2, active))

        def to_string(self):
            return f'ElmBSDF[{NAME!r}, {len(NEURONS)} neurons]'

    return ElmBSDF


def register(*_):
    """Registers the plug-in in the present variant."""
    if mi.variant() is None:
        return
    global RGB_OF_SPECTRUM
    RGB_OF_SPECTRUM = None
    if mi.is_polarized:
        return
    mi.register_bsdf(NAME, make())


register()
mi.detail.add_variant_callback(register)

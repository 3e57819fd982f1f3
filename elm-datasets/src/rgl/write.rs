//! Writes any [`Brdf`] as a file of this format.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::facets::{Facets, mean, safe};
use super::points::Points;
use super::tensor::{F32, MAGIC, U8};
use super::warp::{Axis, Size, Warp};
use super::{Channels, Table, square};
use crate::brdf::{Brdf, EvalError};
use crate::geometry::{DirectionPair, Vector, cartesian, half_vector, polar, reflect};

/// The mean log-cosine difference that a resolution is chosen for.
const TARGET: f64 = 1e-3;
/// Resolutions that are tried, of materials without a grain and with one, whose files are larger.
const ISOTROPIC: [usize; 6] = [16, 24, 32, 48, 64, 96];
const ANISOTROPIC: [usize; 5] = [16, 24, 32, 48, 64];
/// The most azimuths of a file with a grain: directions of its normals do not turn with the light.
const MAX_AZIMUTHS: usize = 32;
/// The most elevations, without a grain and with one.
const MAX_ELEVATIONS: [usize; 2] = [48, MAX_AZIMUTHS / 2];
/// Least and largest resolution.
const RESOLUTIONS: [usize; 2] = [4, 256];
/// The most wavelengths; the database's own files have 195.
const MAX_WAVELENGTHS: usize = 500;
/// The most numbers in a file: a quarter of the bytes that a reader takes.
const MAX_NUMBERS: usize = 1 << 27;
/// Pairs at which a file is held against its model.
const CHECKED: u32 = 4096;

/// A file, and how well it holds its model.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Encoded {
    /// The bytes of the file.
    pub bytes: Vec<u8>,
    /// Points along each side of the tables of values.
    pub resolution: usize,
    /// The mean of $|\ln(1 + f \cos\theta_o) - \ln(1 + g \cos\theta_o)|$ between the model and the file's
    /// interpolated values, over pairs of directions half of which lie near the mirror direction.
    pub log_cosine_error: f64,
}

/// Why a model cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// A model of another number of channels.
    #[error("expected a model of {expected} channels, found {found}")]
    Channels {
        /// Those of the file.
        expected: usize,
        /// Those of the model.
        found: usize,
    },
    /// Too many wavelengths, or too few to interpolate between.
    #[error("expected 2 to {MAX_WAVELENGTHS} wavelengths, found {found}")]
    Wavelengths {
        /// How many.
        found: usize,
    },
    /// Wavelengths out of order.
    #[error(
        "expected positive wavelengths in increasing order, found {found} nm after {before} nm"
    )]
    Order {
        /// One.
        before: f32,
        /// The next.
        found: f32,
    },
    /// A resolution out of range.
    #[error("expected a resolution from {} to {}, found {found}", RESOLUTIONS[0], RESOLUTIONS[1])]
    Resolution {
        /// Which.
        found: usize,
    },
    /// Tables beyond what a reader takes.
    #[error(
        "the file would hold {found} numbers, more than {MAX_NUMBERS}: ask for a lower resolution"
    )]
    Size {
        /// How many.
        found: usize,
    },
    /// The model's own.
    #[error(transparent)]
    Evaluation(#[from] EvalError),
}

/// The bytes of a file that [`Rgl`](super::Rgl), Mitsuba 3 and, of spectra, pbrt-v4 read. Its
/// $\omega_i$ is the model's light.
///
/// The distribution of normals is found of the model's retro-reflection; azimuths `phi_i` are 0 alone, or go
/// around the circle for a model that is not isotropic. Without a `resolution`, the points along each side of
/// a table of values, the least of those tried is taken whose [error](Encoded::log_cosine_error) is at most
/// 0.001, or the largest. There are as many elevations, at most 48; or, with a grain, as many azimuths, at
/// most 32, and half as many elevations. Values that are negative or no numbers become 0.
///
/// # Errors
/// [`WriteError`].
pub fn encode(
    brdf: &dyn Brdf,
    channels: &Channels,
    description: &str,
    resolution: Option<usize>,
) -> Result<Encoded, WriteError> {
    check(brdf, channels, resolution)?;
    let facets = Facets::of(brdf)?;
    let tried: &[usize] = match &resolution {
        Some(one) => std::slice::from_ref(one),
        None if facets.is_isotropic() => &ISOTROPIC,
        None => &ANISOTROPIC,
    };
    let pairs = survey();
    let exact = brdf.eval(&pairs)?;
    let mut best: Option<(Tables, usize, f64)> = None;
    for &resolution in tried {
        let shape = Shape::new(resolution, &facets, channels);
        if shape.numbers() > MAX_NUMBERS {
            match best {
                None => {
                    return Err(WriteError::Size {
                        found: shape.numbers(),
                    });
                }
                Some(_) => break,
            }
        }
        let tables = Tables::new(brdf, &facets, shape)?;
        let mut error = 0.0;
        let mut found = vec![0.0; channels.count()];
        for (pair, exact) in pairs.iter().zip(exact.rows()) {
            tables.write_at(&facets, pair, &mut found);
            for (&found, &exact) in found.iter().zip(exact) {
                let [found, exact] = [found, safe(exact)].map(|f| (f * pair.outgoing[2]).ln_1p());
                error += (found - exact).abs();
            }
        }
        error /= exact.len().max(1) as f64;
        let is_enough = error <= TARGET;
        if best.as_ref().is_none_or(|&(_, _, least)| error < least) {
            best = Some((tables, resolution, error));
        }
        if is_enough {
            break;
        }
    }
    // At least one resolution was tried.
    let Some((tables, resolution, log_cosine_error)) = best else {
        return Err(WriteError::Resolution { found: 0 });
    };
    Ok(Encoded {
        bytes: file(&fields(&facets, &tables, channels, description)),
        resolution,
        log_cosine_error,
    })
}

fn check(
    brdf: &dyn Brdf,
    channels: &Channels,
    resolution: Option<usize>,
) -> Result<(), WriteError> {
    if let Channels::Spectrum(wavelengths) = channels {
        let found = wavelengths.len();
        if !(2..=MAX_WAVELENGTHS).contains(&found) {
            return Err(WriteError::Wavelengths { found });
        }
        let mut before = 0.0;
        for &found in wavelengths {
            if !(found > before && found.is_finite()) {
                return Err(WriteError::Order { before, found });
            }
            before = found;
        }
    }
    let (expected, found) = (channels.count(), brdf.channels());
    if expected != found {
        return Err(WriteError::Channels { expected, found });
    }
    match resolution {
        Some(found) if !(RESOLUTIONS[0]..=RESOLUTIONS[1]).contains(&found) => {
            Err(WriteError::Resolution { found })
        }
        _ => Ok(()),
    }
}

/// The sizes of a file's tables.
#[derive(Clone)]
struct Shape {
    phi_i: Axis,
    theta_i: Axis,
    channels: usize,
    /// Of `vndf`.
    visible: Size,
    /// Of values.
    values: Size,
}

impl Shape {
    fn new(resolution: usize, facets: &Facets, channels: &Channels) -> Self {
        // As the file has them, in single precision.
        let around = |steps: usize| {
            let at = |index| f64::from((PI * (2.0 * index as f64 / steps as f64 - 1.0)) as f32);
            Axis((0..=steps).map(at).collect())
        };
        // Denser towards the horizon, where reflectance changes fastest.
        let elevations = |steps: usize| {
            let share = |index| 1.0 - (1.0 - index as f64 / steps as f64).powf(1.5);
            let at = |index| f64::from((FRAC_PI_2 * share(index)) as f32);
            Axis((0..=steps).map(at).collect())
        };
        let (phi_i, elevation_steps, visible) = if facets.is_isotropic() {
            let steps = resolution.min(MAX_ELEVATIONS[0]);
            (Axis(vec![0.0]), steps, (128, 32))
        } else {
            let steps = (resolution / 2).min(MAX_ELEVATIONS[1]);
            (around(resolution.min(MAX_AZIMUTHS)), steps, (64, 64))
        };
        Self {
            phi_i,
            theta_i: elevations(elevation_steps),
            channels: channels.count(),
            visible: Size {
                width: visible.0,
                height: visible.1,
            },
            values: Size {
                width: resolution,
                height: resolution,
            },
        }
    }

    fn slices(&self) -> usize {
        self.phi_i.0.len() * self.theta_i.0.len()
    }

    fn numbers(&self) -> usize {
        self.slices() * (self.visible.area() + (self.channels + 1) * self.values.area())
    }

    /// The direction of the light of each slice; the last elevation is a hair above the horizon.
    fn incident(&self) -> Vec<Vector> {
        let of = |&phi: &f64| {
            let elevations = self.theta_i.0.iter();
            elevations.map(move |&theta| cartesian(theta.min(FRAC_PI_2), phi))
        };
        self.phi_i.0.iter().flat_map(of).collect()
    }
}

/// The tables of a file that depend on its resolution.
struct Tables {
    shape: Shape,
    /// By slice.
    vndf: Vec<f32>,
    warp: Warp,
    /// By slice and channel.
    values: Table,
    /// By slice.
    luminance: Vec<f32>,
}

impl Tables {
    fn new(brdf: &dyn Brdf, facets: &Facets, shape: Shape) -> Result<Self, WriteError> {
        let incident = shape.incident();
        let mut vndf = Vec::with_capacity(incident.len() * shape.visible.area());
        for &light in &incident {
            vndf.extend(facets.visible(brdf, light, shape.visible)?);
        }
        // Every density has a floor, so that there are no zeros only.
        let warp =
            Warp::new(shape.visible, vndf.iter().copied()).map_err(|_| WriteError::Resolution {
                found: shape.values.width,
            })?;
        let (mut numbers, mut luminance) = (Vec::new(), Vec::new());
        for (slice, &light) in incident.iter().enumerate() {
            let points = Points::new(facets, &warp, shape.values, (slice, light));
            let values = brdf.eval(&points.pairs)?;
            for channel in values.columns() {
                let smooth = channel.iter().zip(&points.scales);
                numbers.extend(smooth.map(|(&value, scale)| (safe(value) * scale) as f32));
            }
            let means: Vec<f64> = values.rows().into_iter().map(mean).collect();
            luminance.extend(points.luminance(&means));
        }
        let values = Table {
            size: shape.values,
            numbers,
        };
        Ok(Self {
            shape,
            vndf,
            warp,
            values,
            luminance,
        })
    }

    /// The values that a reader interpolates.
    fn write_at(&self, facets: &Facets, pair: &DirectionPair, values: &mut [f64]) {
        values.fill(0.0);
        let Some(normal) = half_vector(pair.incident, pair.outgoing) else {
            return;
        };
        let ((theta_i, phi_i), (theta_m, phi_m)) = (polar(pair.incident), polar(normal));
        let turned = if facets.is_isotropic() { phi_i } else { 0.0 };
        let azimuth = (phi_m - turned + PI) / TAU;
        let seen = [square(theta_m), azimuth - azimuth.floor()];
        let blend = Axis::blend(self.shape.phi_i.around(phi_i), &self.shape.theta_i, theta_i);
        let flat = self.warp.flatten(&blend, seen);
        let highlight = facets.ndf.at(0, seen)
            / (4.0 * facets.projected_area(pair.incident) * pair.outgoing[2]);
        let count = values.len();
        for (channel, value) in values.iter_mut().enumerate() {
            let part = |&(slice, weight): &(usize, f64)| {
                weight * self.values.at(slice * count + channel, flat)
            };
            *value = blend.iter().map(part).sum::<f64>() * highlight;
        }
    }
}

/// Pairs of directions at which a file is held against its model: half with both uniform over the hemisphere,
/// half with the half vector up to 0.3 radians from the normal, by a low-discrepancy sequence (M. Roberts's
/// R4).
fn survey() -> Vec<DirectionPair> {
    const STEPS: [f64; 4] = [
        0.856_674_883_854_502_9,
        0.733_891_856_627_126,
        0.628_706_721_037_808_7,
        0.538_597_257_223_613_6,
    ];
    /// The least cosine.
    const LEAST: f64 = 0.087;
    let at = |number: u32| {
        let [a, b, c, d] = STEPS.map(|step| (0.5 + step * f64::from(number)).fract());
        let cosine = |u: f64| LEAST + (1.0 - LEAST) * u;
        let incident = cartesian(cosine(a).acos(), TAU * b);
        let outgoing = if number.is_multiple_of(2) {
            cartesian(cosine(c).acos(), TAU * d)
        } else {
            reflect(incident, cartesian(0.3 * c, TAU * d))
        };
        DirectionPair { incident, outgoing }
    };
    let pairs = (1..=CHECKED).map(at);
    pairs.filter(|pair| pair.outgoing[2] > LEAST).collect()
}

/// A field of a file: its name, its shape, and what it holds.
struct Contents(&'static str, Vec<usize>, Numbers);

enum Numbers {
    Bytes(Vec<u8>),
    Floats(Vec<f32>),
}

fn fields(
    facets: &Facets,
    tables: &Tables,
    channels: &Channels,
    description: &str,
) -> Vec<Contents> {
    let shape = &tables.shape;
    let axis = |axis: &Axis| axis.0.iter().map(|&value| value as f32).collect();
    let (phi, theta) = (shape.phi_i.0.len(), shape.theta_i.0.len());
    let square = |size: Size| vec![size.height, size.width];
    let by_slice = |size: Size| vec![phi, theta, size.height, size.width];
    let floats = |name, shape, numbers| Contents(name, shape, Numbers::Floats(numbers));
    let bytes = |name, bytes: Vec<u8>| Contents(name, vec![bytes.len()], Numbers::Bytes(bytes));
    let name = match channels {
        Channels::Rgb => "rgb",
        Channels::Spectrum(_) => "spectra",
    };
    let side = shape.values.width;
    let mut fields = vec![
        bytes("description", description.as_bytes().to_vec()),
        floats("phi_i", vec![phi], axis(&shape.phi_i)),
        floats("theta_i", vec![theta], axis(&shape.theta_i)),
        floats("ndf", square(facets.ndf.size), facets.ndf.numbers.clone()),
        floats(
            "sigma",
            square(facets.sigma.size),
            facets.sigma.numbers.clone(),
        ),
        floats("vndf", by_slice(shape.visible), tables.vndf.clone()),
        floats(
            "luminance",
            by_slice(shape.values),
            tables.luminance.clone(),
        ),
        floats(
            name,
            vec![phi, theta, shape.channels, side, side],
            tables.values.numbers.clone(),
        ),
        bytes("jacobian", vec![1]),
    ];
    if let Channels::Spectrum(wavelengths) = channels {
        fields.push(floats(
            "wavelengths",
            vec![wavelengths.len()],
            wavelengths.clone(),
        ));
    }
    fields
}

/// The container, its numbers at bytes divisible by eight.
fn file(fields: &[Contents]) -> Vec<u8> {
    let head: usize = fields
        .iter()
        .map(|Contents(name, shape, _)| 2 + name.len() + 2 + 1 + 8 + 8 * shape.len())
        .sum();
    let mut out = Vec::new();
    out.extend(MAGIC);
    out.extend([1, 0]);
    out.extend((fields.len() as u32).to_le_bytes());
    let mut offset = (out.len() + head).next_multiple_of(8);
    for Contents(name, shape, numbers) in fields {
        let (code, width) = match numbers {
            Numbers::Bytes(_) => (U8, 1),
            Numbers::Floats(_) => (F32, 4),
        };
        out.extend((name.len() as u16).to_le_bytes());
        out.extend(name.as_bytes());
        out.extend((shape.len() as u16).to_le_bytes());
        out.push(code);
        out.extend((offset as u64).to_le_bytes());
        for &size in shape {
            out.extend((size as u64).to_le_bytes());
        }
        offset = (offset + width * shape.iter().product::<usize>()).next_multiple_of(8);
    }
    for Contents(_, _, numbers) in fields {
        out.resize(out.len().next_multiple_of(8), 0);
        match numbers {
            Numbers::Bytes(bytes) => out.extend(bytes),
            Numbers::Floats(floats) => out.extend(floats.iter().flat_map(|f| f.to_le_bytes())),
        }
    }
    out
}

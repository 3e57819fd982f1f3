//! Samples directions about in proportion to a model, by a mixture of the cosine and a few GGX lobes in
//! closed form.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::random::{Purpose, numbers, pixel_seed};
use crate::vector::ShadingFrame;
use elm_datasets::geometry::{DirectionPair, Vector, cartesian};

/// Roughnesses of the GGX lobes that are tried.
const GLOSSY: [f64; 6] = [0.01, 0.025, 0.06, 0.12, 0.25, 0.5];
/// How far the lobes like the cosine that are tried are tilted.
const TILTED: [f64; 4] = [-0.4, 0.2, 0.45, 0.75];
/// Widths in radians of the round lobes that are tried, about the mirror direction and about the viewer.
const ROUND: [f64; 4] = [0.05, 0.15, 0.5, 1.5];
/// Lobes kept besides these.
const KEPT: usize = 3;
/// Viewing angles at which the model is asked.
const VIEWS: usize = 16;
/// Directions at each of these angles: the first to fit the mixture, the others, drawn from it, for what the
/// model reflects.
const PILOT: u32 = 512;
const FINAL: u32 = 1024;
/// Least shares of the cosine and of all directions alike, so that what was missed is found as well, next to the
/// horizon, too.
const LEAST: [f64; 2] = [0.07, 0.03];
/// Coefficients of a weight as a polynomial in the viewer's cosine.
const TERMS: usize = 4;
/// Steps of the search for the weights, with all lobes and after each that is left out.
const STEPS: usize = 40;
const STEPS_AFTER: usize = 8;
/// Rounds of the search for widths and tilts, and between which they are.
const ROUNDS: usize = 4;
const WIDTHS: (f64, f64) = (0.005, 4.0);
const MAX_TILT: f64 = 0.95;

/// A density of directions in closed form. What falls below the horizon is reflected upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lobe {
    Cosine,
    Uniform,
    /// The cosine's disc moved towards the mirror direction, or with a negative factor towards the viewer, by
    /// a conformal map of the disc onto itself.
    Tilted {
        factor: f64,
    },
    /// The viewer reflected at normals of the GGX distribution that are visible to it: its highlight grows
    /// longer towards grazing angles.
    Ggx {
        alpha: f64,
    },
    /// As round at every angle, about the mirror direction or the viewer: in proportion to
    /// $(s + 1 - \cos\delta)^{-2}$ with $\delta$ the angle to its axis and $s$ half the square of its width.
    Round {
        width: f64,
        retro: bool,
    },
}

/// The direction on the other side of the surface.
fn below([x, y, z]: Vector) -> Vector {
    [x, y, -z]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Lobe {
    /// Density in solid angle at `incident`, above the horizon.
    fn density(self, outgoing: Vector, incident: Vector) -> f64 {
        let [x, y, z] = outgoing;
        match self {
            Self::Cosine => incident[2] / PI,
            Self::Uniform => 1.0 / TAU,
            Self::Tilted { factor } => {
                let (a, b) = (-factor * x, -factor * y);
                let moved = a * a + b * b;
                let sine = incident[0] * incident[0] + incident[1] * incident[1];
                let distance = 1.0 - 2.0 * (a * incident[0] + b * incident[1]) + moved * sine;
                incident[2] / PI * ((1.0 - moved) / distance).powi(2)
            }
            Self::Ggx { alpha } => {
                let squared = alpha * alpha;
                let normals = |to: Vector| {
                    let sum = [x + to[0], y + to[1], z + to[2]];
                    let tangential = sum[0] * sum[0] + sum[1] * sum[1];
                    let vertical = sum[2] * sum[2];
                    let (length, spread) = (tangential + vertical, tangential + squared * vertical);
                    if sum[2] > 0.0 {
                        squared * length * length / (PI * spread * spread)
                    } else {
                        0.0
                    }
                };
                let visible = z + (squared + (1.0 - squared) * z * z).sqrt();
                (normals(incident) + normals(below(incident))) / (2.0 * visible)
            }
            Self::Round { width, retro } => {
                let s = width * width / 2.0;
                let axis = if retro { outgoing } else { [-x, -y, z] };
                let about = |to: Vector| (s + 1.0 - dot(axis, to)).powi(-2);
                s * (s + 2.0) / (2.0 * TAU) * (about(incident) + about(below(incident)))
            }
        }
    }

    /// An incident direction for two uniform numbers.
    fn sample(self, outgoing: Vector, [a, b]: [f64; 2]) -> Vector {
        let (sin, cos) = (TAU * a).sin_cos();
        let [x, y, z] = outgoing;
        let found = match self {
            Self::Cosine => [b.sqrt() * cos, b.sqrt() * sin, (1.0 - b).sqrt()],
            Self::Uniform => {
                let radius = (b * (2.0 - b)).sqrt();
                [radius * cos, radius * sin, 1.0 - b]
            }
            Self::Tilted { factor } => {
                // (z + w) / (1 + conj(w) z) with z in the disc, w where its middle goes.
                let w = (-factor * x, -factor * y);
                let z = (b.sqrt() * cos, b.sqrt() * sin);
                let above = (z.0 + w.0, z.1 + w.1);
                let below = (1.0 + w.0 * z.0 + w.1 * z.1, w.0 * z.1 - w.1 * z.0);
                let size = below.0 * below.0 + below.1 * below.1;
                let re = (above.0 * below.0 + above.1 * below.1) / size;
                let im = (above.1 * below.0 - above.0 * below.1) / size;
                [re, im, (1.0 - re * re - im * im).max(0.0).sqrt()]
            }
            Self::Ggx { alpha } => {
                // A cap of the sphere, as the stretched surface shows it (Dupuy and Benyoub, 2023).
                let stretched = unit([alpha * x, alpha * y, z]);
                let height = (1.0 - b) * (1.0 + stretched[2]) - stretched[2];
                let radius = (1.0 - height * height).max(0.0).sqrt();
                let normal = unit([
                    alpha * (radius * cos + stretched[0]),
                    alpha * (radius * sin + stretched[1]),
                    (height + stretched[2]).max(0.0),
                ]);
                let along = 2.0 * dot(outgoing, normal);
                [0, 1, 2].map(|k| along * normal[k] - outgoing[k])
            }
            Self::Round { width, retro } => {
                let s = width * width / 2.0;
                let off = 2.0 * b * s / (s + 2.0 * (1.0 - b));
                let radius = (off * (2.0 - off)).max(0.0).sqrt();
                let axis = if retro { outgoing } else { [-x, -y, z] };
                let frame = ShadingFrame::from_normal(axis.into());
                frame.world([radius * cos, radius * sin, 1.0 - off]).into()
            }
        };
        let [x, y, z] = unit(found);
        [x, y, z.abs()]
    }

    /// The same with its width or tilt times a factor, if it has one.
    fn wider(self, factor: f64) -> Option<Self> {
        let scaled = |width: f64| (width * factor).clamp(WIDTHS.0, WIDTHS.1);
        match self {
            Self::Cosine | Self::Uniform => None,
            Self::Tilted { factor: tilt } => Some(Self::Tilted {
                factor: (tilt * factor).clamp(-MAX_TILT, MAX_TILT),
            }),
            Self::Ggx { alpha } => Some(Self::Ggx {
                alpha: scaled(alpha).min(1.0),
            }),
            Self::Round { width, retro } => Some(Self::Round {
                width: scaled(width),
                retro,
            }),
        }
    }
}

fn unit(v: Vector) -> Vector {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 {
        v.map(|x| x / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// Bernstein's polynomials at the viewer's cosine: not negative, with sum 1.
fn terms(cosine: f64) -> [f64; TERMS] {
    let x = cosine.clamp(0.0, 1.0);
    let y = 1.0 - x;
    [y * y * y, 3.0 * y * y * x, 3.0 * y * x * x, x * x * x]
}

/// A density like a model's $f \cos\theta_i$ for any viewer: the cosine and GGX lobes, weighted by
/// polynomials in the viewer's cosine.
///
/// The model is taken to be isotropic and symmetric in the azimuth; where it is not, the density stays a
/// density, and only the noise grows.
#[derive(Debug, Clone)]
pub(crate) struct LobeMixture {
    /// Those of [`LEAST`] first.
    lobes: Vec<(Lobe, [f64; TERMS])>,
}

/// Directions at which a model is asked, each with the solid angle that it stands for.
pub(crate) struct Points {
    pub(crate) pairs: Vec<DirectionPair>,
    weights: Vec<f64>,
}

impl Points {
    /// From the density of `mixture` at each viewing angle.
    fn of(mixture: &LobeMixture, count: u32) -> Self {
        let mut pairs = Vec::with_capacity(VIEWS * count as usize);
        let mut weights = Vec::with_capacity(VIEWS * count as usize);
        for view in 0..VIEWS {
            let outgoing = cartesian(view_angle(view), 0.0);
            for index in 0..count {
                let seed = pixel_seed(0, view as u32);
                let [a, b, ..] = numbers(seed, index, Purpose::Scatter(0));
                let (incident, density) = mixture.sample(outgoing, [a, b]);
                pairs.push(DirectionPair { incident, outgoing });
                weights.push(1.0 / (density * f64::from(count)));
            }
        }
        Self { pairs, weights }
    }

    fn densities(&self, lobe: Lobe) -> Vec<f64> {
        let pairs = self.pairs.iter();
        pairs
            .map(|pair| lobe.density(pair.outgoing, pair.incident))
            .collect()
    }

    /// Directional albedo at each viewing angle (theta_o in radians, albedo) by the values at all pairs.
    pub(crate) fn albedo(&self, values: &[f64]) -> Vec<(f64, f64)> {
        let count = self.pairs.len() / VIEWS;
        let all = self.pairs.iter().zip(&self.weights).zip(values);
        let parts: Vec<f64> = all
            .map(|((pair, weight), value)| value * pair.incident[2] * weight)
            .collect();
        parts
            .chunks(count)
            .enumerate()
            .map(|(view, parts)| (view_angle(view), parts.iter().sum()))
            .collect()
    }
}

fn view_angle(view: usize) -> f64 {
    (view as f64 + 0.5) / VIEWS as f64 * FRAC_PI_2
}

impl LobeMixture {
    /// All lobes that are tried, each alike.
    fn candidates() -> Self {
        let round = |retro| ROUND.iter().map(move |&width| Lobe::Round { width, retro });
        let lobes = [Lobe::Cosine, Lobe::Uniform]
            .into_iter()
            .chain(TILTED.map(|factor| Lobe::Tilted { factor }))
            .chain(GLOSSY.iter().map(|&alpha| Lobe::Ggx { alpha }))
            .chain(round(false))
            .chain(round(true));
        let weight = 1.0 / (LEAST.len() + TILTED.len() + GLOSSY.len() + 2 * ROUND.len()) as f64;
        Self {
            lobes: lobes.map(|lobe| (lobe, [weight; TERMS])).collect(),
        }
    }

    /// Where a model is asked before anything is known of it.
    pub(crate) fn pilot() -> Points {
        Points::of(&Self::candidates(), PILOT)
    }

    /// Mirror and retro-reflection at each viewing angle, where models peak.
    pub(crate) fn peaks() -> Vec<DirectionPair> {
        let peaks = |view| {
            let outgoing = cartesian(view_angle(view), 0.0);
            [PI, 0.0].map(|phi| DirectionPair {
                incident: cartesian(view_angle(view), phi),
                outgoing,
            })
        };
        (0..VIEWS).flat_map(peaks).collect()
    }

    /// Where this mixture asks a model.
    pub(crate) fn points(&self) -> Points {
        Points::of(self, FINAL)
    }

    /// The mixture with the least variance of $f \cos\theta_i$ over its density, by the model's values, finite
    /// and not negative, at the pairs of [`pilot`](Self::pilot).
    pub(crate) fn fit(points: &Points, values: &[f64]) -> Self {
        let mut problem = Problem::new(points, values);
        let mut mixture = Self::candidates();
        problem.improve(&mut mixture, STEPS);
        while mixture.lobes.len() > LEAST.len() + KEPT {
            let least = (LEAST.len()..mixture.lobes.len())
                .map(|lobe| (lobe, problem.objective(&mixture, Some(lobe))))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((lobe, _)) = least else { break };
            mixture.lobes.remove(lobe);
            problem.densities.remove(lobe);
            mixture.normalise();
            problem.improve(&mut mixture, STEPS_AFTER);
        }
        problem.refine(points, &mut mixture);
        problem.improve(&mut mixture, STEPS);
        mixture
            .lobes
            .retain(|(_, weights)| weights.iter().any(|&w| w > 1e-6));
        mixture.normalise();
        mixture
    }

    /// Gives all weights the sum 1, the first lobes at least their least share.
    fn normalise(&mut self) {
        for term in 0..TERMS {
            let mut rest = 1.0;
            let mut is_least = [false; LEAST.len()];
            loop {
                let is_free = |lobe: usize| !is_least.get(lobe).is_some_and(|&is| is);
                let weights = self.lobes.iter().map(|(_, w)| w[term]).enumerate();
                let free: f64 = weights
                    .filter(|(lobe, _)| is_free(*lobe))
                    .map(|(_, w)| w)
                    .sum();
                for (lobe, (_, weights)) in self.lobes.iter_mut().enumerate() {
                    if is_free(lobe) {
                        weights[term] *= if free > 0.0 { rest / free } else { 0.0 };
                    }
                }
                let below = (0..LEAST.len())
                    .find(|&lobe| is_free(lobe) && self.lobes[lobe].1[term] < LEAST[lobe]);
                let Some(lobe) = below else { break };
                self.lobes[lobe].1[term] = LEAST[lobe];
                is_least[lobe] = true;
                rest -= LEAST[lobe];
            }
            // Nothing is reflected: all weights but the least are zero.
            let total: f64 = self.lobes.iter().map(|(_, w)| w[term]).sum();
            self.lobes[0].1[term] += 1.0 - total;
        }
    }

    /// The lobes with their shares for a viewer.
    fn shares(&self, outgoing: Vector) -> impl Iterator<Item = (Lobe, f64)> {
        let terms = terms(outgoing[2]);
        let share =
            move |weights: &[f64; TERMS]| weights.iter().zip(terms).map(|(w, t)| w * t).sum();
        self.lobes
            .iter()
            .map(move |(lobe, weights)| (*lobe, share(weights)))
    }

    /// The lobe that a uniform number chooses, and where in that lobe's share the number lies, from 0 to 1.
    fn choose(&self, outgoing: Vector, u: f64) -> (Lobe, f64) {
        let (mut before, mut chosen) = (0.0, (Lobe::Cosine, u));
        for (lobe, share) in self.shares(outgoing) {
            if share > 0.0 && u >= before {
                chosen = (lobe, ((u - before) / share).min(1.0 - f64::EPSILON));
            }
            before += share;
        }
        chosen
    }

    /// An incident direction for a viewer at `outgoing`, with its density in solid angle.
    pub(crate) fn sample(&self, outgoing: Vector, [a, b]: [f64; 2]) -> (Vector, f64) {
        let (lobe, a) = self.choose(outgoing, a);
        let incident = lobe.sample(outgoing, [a, b]);
        (incident, self.density(outgoing, incident))
    }

    /// The density in solid angle with which [`sample`](Self::sample) finds `incident`.
    pub(crate) fn density(&self, outgoing: Vector, incident: Vector) -> f64 {
        if incident[2].is_nan() || incident[2] <= 0.0 {
            return 0.0;
        }
        let parts = self
            .shares(outgoing)
            .map(|(lobe, share)| share * lobe.density(outgoing, incident));
        parts.sum()
    }
}

/// The search for weights: the least sum over viewing angles of the logarithm of the second moment of
/// $f \cos\theta_i$ over the density.
struct Problem {
    /// Of each lobe at each point.
    densities: Vec<Vec<f64>>,
    /// The square of f cos theta_i at each point, times its solid angle.
    squares: Vec<f64>,
    terms: Vec<[f64; TERMS]>,
}

impl Problem {
    fn new(points: &Points, values: &[f64]) -> Self {
        let all = points.pairs.iter().zip(&points.weights).zip(values);
        Self {
            densities: LobeMixture::candidates()
                .lobes
                .iter()
                .map(|(lobe, _)| points.densities(*lobe))
                .collect(),
            squares: all
                .map(|((pair, weight), value)| (value * pair.incident[2]).powi(2) * weight)
                .collect(),
            terms: (0..VIEWS)
                .map(|view| terms(view_angle(view).cos()))
                .collect(),
        }
    }

    /// Density of the mixture at each point of a view, without one lobe if that is asked.
    fn mixed(&self, mixture: &LobeMixture, view: usize, without: Option<usize>) -> Vec<f64> {
        let count = self.squares.len() / VIEWS;
        let mut mixed = vec![0.0; count];
        let mut total = 0.0;
        for (lobe, (_, weights)) in mixture.lobes.iter().enumerate() {
            if without == Some(lobe) {
                continue;
            }
            let share: f64 = weights
                .iter()
                .zip(self.terms[view])
                .map(|(w, t)| w * t)
                .sum();
            total += share;
            let densities = &self.densities[lobe][view * count..(view + 1) * count];
            for (sum, density) in mixed.iter_mut().zip(densities) {
                *sum += share * density;
            }
        }
        for density in &mut mixed {
            *density = (*density / total).max(f64::MIN_POSITIVE);
        }
        mixed
    }

    fn objective(&self, mixture: &LobeMixture, without: Option<usize>) -> f64 {
        let count = self.squares.len() / VIEWS;
        let moment = |view: usize| -> f64 {
            let squares = &self.squares[view * count..(view + 1) * count];
            let mixed = self.mixed(mixture, view, without);
            squares.iter().zip(&mixed).map(|(s, p)| s / p).sum()
        };
        let moments = (0..VIEWS).map(moment).filter(|&m| m > 0.0);
        moments.map(f64::ln).sum()
    }

    /// Takes widths and tilts between those tried.
    fn refine(&mut self, points: &Points, mixture: &mut LobeMixture) {
        let mut factor = 1.25_f64;
        for _ in 0..ROUNDS {
            let mut best = self.objective(mixture, None);
            for index in LEAST.len()..mixture.lobes.len() {
                for factor in [factor, 1.0 / factor] {
                    let before = mixture.lobes[index].0;
                    let Some(lobe) = before.wider(factor) else {
                        continue;
                    };
                    mixture.lobes[index].0 = lobe;
                    let densities =
                        std::mem::replace(&mut self.densities[index], points.densities(lobe));
                    let found = self.objective(mixture, None);
                    if found < best {
                        best = found;
                    } else {
                        mixture.lobes[index].0 = before;
                        self.densities[index] = densities;
                    }
                }
            }
            self.improve(mixture, STEPS_AFTER);
            factor = factor.sqrt();
        }
    }

    /// Steps that cannot make the sum larger: with r the share of a lobe in the density, s / p is at most the
    /// sum of r^2 s / (w p_lobe) for any other weights w, which is least for w as the root of its coefficient.
    fn improve(&mut self, mixture: &mut LobeMixture, steps: usize) {
        let count = self.squares.len() / VIEWS;
        for _ in 0..steps {
            let mut gains = vec![[0.0; TERMS]; mixture.lobes.len()];
            for view in 0..VIEWS {
                let squares = &self.squares[view * count..(view + 1) * count];
                let mixed = self.mixed(mixture, view, None);
                let moment: f64 = squares.iter().zip(&mixed).map(|(s, p)| s / p).sum();
                if moment.is_nan() || moment <= 0.0 {
                    continue;
                }
                let ratios: Vec<f64> = squares
                    .iter()
                    .zip(&mixed)
                    .map(|(s, p)| s / (p * p))
                    .collect();
                for (gain, densities) in gains.iter_mut().zip(&self.densities) {
                    let densities = &densities[view * count..(view + 1) * count];
                    let sum: f64 = densities.iter().zip(&ratios).map(|(d, r)| d * r).sum();
                    for (gain, term) in gain.iter_mut().zip(self.terms[view]) {
                        *gain += sum / moment * term;
                    }
                }
            }
            for ((_, weights), gain) in mixture.lobes.iter_mut().zip(&gains) {
                for (weight, gain) in weights.iter_mut().zip(gain) {
                    *weight *= gain.sqrt();
                }
            }
            mixture.normalise();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOBES: [Lobe; 10] = [
        Lobe::Cosine,
        Lobe::Uniform,
        Lobe::Tilted { factor: -0.4 },
        Lobe::Tilted { factor: 0.75 },
        Lobe::Ggx { alpha: 0.1 },
        Lobe::Ggx { alpha: 0.7 },
        Lobe::Round {
            width: 0.1,
            retro: false,
        },
        Lobe::Round {
            width: 1.0,
            retro: false,
        },
        Lobe::Round {
            width: 0.1,
            retro: true,
        },
        Lobe::Round {
            width: 1.0,
            retro: true,
        },
    ];

    /// Shares of the hemisphere's parts, 8 in theta and 8 in phi, by midpoints in cosine and azimuth, denser
    /// towards the plane of the viewer, where lobes are narrow at grazing angles.
    fn integrals(lobe: Lobe, outgoing: Vector) -> Vec<f64> {
        const FINE: usize = 90;
        let mut parts = vec![0.0; 64];
        for row in 0..8 * FINE {
            let angle = |row: usize| row as f64 / (8 * FINE) as f64 * FRAC_PI_2;
            let (near, far) = (angle(row).cos(), angle(row + 1).cos());
            let theta = ((near + far) / 2.0).acos();
            for column in 0..8 * FINE {
                let phi = |step: f64| {
                    let t = ((column % FINE) as f64 + step) / FINE as f64;
                    ((column / FINE) as f64 + t * t * (3.0 - 2.0 * t)) / 8.0 * TAU
                };
                let density = lobe.density(outgoing, cartesian(theta, phi(0.5)));
                let area = (near - far) * (phi(1.0) - phi(0.0));
                parts[row / FINE * 8 + column / FINE] += density * area;
            }
        }
        parts
    }

    #[test]
    fn every_lobe_has_the_integral_1_and_is_sampled_by_its_density() {
        for lobe in LOBES {
            for theta in [0.0, 0.6, 1.2, 1.54] {
                let outgoing = cartesian(theta, 0.0);
                let parts = integrals(lobe, outgoing);
                let total: f64 = parts.iter().sum();
                // Midpoints at a tenth of the narrowest lobe's width.
                assert!((total - 1.0).abs() < 2e-3, "{lobe:?} at {theta}: {total}");
                let mut counts = vec![0.0; 64];
                let draws = 16384;
                for index in 0..draws {
                    let [a, b, ..] = numbers(pixel_seed(3, 1), index, Purpose::Scatter(1));
                    let w = lobe.sample(outgoing, [a, b]);
                    let row = (w[2].acos() / FRAC_PI_2 * 8.0) as usize;
                    let column = (w[1].atan2(w[0]).rem_euclid(TAU) / TAU * 8.0) as usize;
                    counts[row.min(7) * 8 + column.min(7)] += 1.0 / f64::from(draws);
                }
                for (count, part) in counts.iter().zip(&parts) {
                    // Five deviations of independent draws; Sobol's have less.
                    let deviation = (part / f64::from(draws)).sqrt();
                    let bound = 5.0 * deviation + 2e-3 * part + 1.0 / f64::from(draws);
                    assert!(
                        (count - part).abs() < bound,
                        "{lobe:?} at {theta}: {count} {part}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_lobe_among_those_tried_is_found_and_a_black_surface_gets_the_cosine() {
        let points = LobeMixture::pilot();
        let values: Vec<f64> = points
            .pairs
            .iter()
            .map(|p| Lobe::Ggx { alpha: 0.06 }.density(p.outgoing, p.incident) / p.incident[2])
            .collect();
        let found = LobeMixture::fit(&points, &values);
        let outgoing = cartesian(1.0, 0.0);
        let shares: Vec<(Lobe, f64)> = found.shares(outgoing).collect();
        let ggx = shares.iter().filter(
            |(lobe, _)| matches!(lobe, Lobe::Ggx { alpha } if (alpha / 0.06 - 1.0).abs() < 0.2),
        );
        let share: f64 = ggx.map(|(_, share)| share).sum();
        assert!(share > 0.85, "{shares:?}");

        let black = LobeMixture::fit(&points, &vec![0.0; points.pairs.len()]);
        let incident = cartesian(0.5, 2.0);
        let density = black.density(outgoing, incident);
        let expected = 0.97 * 0.5_f64.cos() / PI + 0.03 / TAU;
        assert!((density - expected).abs() < 1e-12, "{black:?}");
    }
}

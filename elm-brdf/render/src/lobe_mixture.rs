//! Samples directions about in proportion to a model, by a mixture of a few lobes.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::lobe::Lobe;
use crate::random::{Purpose, numbers, pixel_seed};
use elm_datasets::geometry::{DirectionPair, Vector, cartesian};

/// Roughnesses of the GGX lobes that are tried.
const GLOSSY: [f64; 6] = [0.01, 0.025, 0.06, 0.12, 0.25, 0.5];
/// Roughnesses along and across a direction that are tried for models that are not isotropic, and directions
/// over half a turn.
const DIRECTED: [[f64; 2]; 4] = [[0.03, 0.12], [0.06, 0.3], [0.15, 0.5], [0.1, 0.2]];
const TURNS: u32 = 8;
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
/// The first where the model is not isotropic.
const PILOT_DIRECTED: u32 = 2048;
/// Least shares of the cosine and of all directions alike, so that what was missed is found as well, next to
/// the horizon, too.
const LEAST: [f64; 2] = [0.07, 0.03];
/// Multiples of this angle fill the circle evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Coefficients of a weight as a polynomial in the viewer's cosine.
const TERMS: usize = 4;
/// Steps of the search for the weights, with all lobes and after each that is left out.
const STEPS: usize = 40;
const STEPS_AFTER: usize = 8;
/// Rounds of the search for widths and tilts.
const ROUNDS: usize = 4;

/// Bernstein's polynomials at the viewer's cosine: not negative, with sum 1.
fn terms(cosine: f64) -> [f64; TERMS] {
    let x = cosine.clamp(0.0, 1.0);
    let y = 1.0 - x;
    [y * y * y, 3.0 * y * y * x, 3.0 * y * x * x, x * x * x]
}

/// A density like a model's $f \cos\theta_i$ for any viewer: lobes, weighted by
/// polynomials in the viewer's cosine.
///
/// Lobes are symmetric in the azimuth about the viewer or, of a model that is not isotropic, about a
/// direction of the surface; where the model is not, the density stays a density, and only the noise grows.
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
            for index in 0..count {
                // From every side, for a model that is not isotropic.
                let outgoing = cartesian(view_angle(view), f64::from(index) * GOLDEN_ANGLE);
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
    /// All lobes that are tried, each alike; for a model that is not isotropic those that have a direction,
    /// too.
    fn candidates(isotropic: bool) -> Self {
        let round = |retro| ROUND.iter().map(move |&width| Lobe::Round { width, retro });
        let turns = (0..TURNS).map(|turn| f64::from(turn) / f64::from(TURNS) * PI);
        let directed: Vec<Lobe> = turns
            .flat_map(|turn| DIRECTED.map(|alpha| Lobe::Ggx { alpha, turn }))
            .collect();
        let lobes: Vec<Lobe> = [Lobe::Cosine, Lobe::Uniform]
            .into_iter()
            .chain(TILTED.map(|factor| Lobe::Tilted { factor }))
            .chain(GLOSSY.map(|alpha| Lobe::Ggx {
                alpha: [alpha; 2],
                turn: 0.0,
            }))
            .chain(if isotropic { Vec::new() } else { directed })
            .chain(round(false))
            .chain(round(true))
            .collect();
        let weight = 1.0 / lobes.len() as f64;
        Self {
            lobes: lobes
                .into_iter()
                .map(|lobe| (lobe, [weight; TERMS]))
                .collect(),
        }
    }

    /// Where a model is asked before anything is known of it.
    pub(crate) fn pilot(isotropic: bool) -> Points {
        let count = if isotropic { PILOT } else { PILOT_DIRECTED };
        Points::of(&Self::candidates(isotropic), count)
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

    /// The mixture with the least variance of $f \cos\theta_i$ over its density, by the model's values,
    /// finite and not negative, at the pairs of [`pilot`](Self::pilot).
    pub(crate) fn fit(points: &Points, values: &[f64], isotropic: bool) -> Self {
        let mut mixture = Self::candidates(isotropic);
        let mut problem = Problem::new(&mixture, points, values);
        problem.improve(&mut mixture, STEPS);
        while mixture.lobes.len() > LEAST.len() + KEPT {
            let least = (LEAST.len()..mixture.lobes.len())
                .map(|lobe| (lobe, problem.objective(&mixture, Some(lobe))))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((lobe, _)) = least else { break };
            mixture.lobes.remove(lobe);
            problem.densities.remove(lobe);
            mixture.normalize();
            problem.improve(&mut mixture, STEPS_AFTER);
        }
        problem.refine(points, &mut mixture);
        problem.improve(&mut mixture, STEPS);
        mixture
            .lobes
            .retain(|(_, weights)| weights.iter().any(|&w| w > 1e-6));
        mixture.normalize();
        mixture
    }

    /// Gives all weights the sum 1, the first lobes at least their least share.
    fn normalize(&mut self) {
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
                        weights[term] = if free > 0.0 {
                            weights[term] * (rest / free)
                        } else {
                            0.0
                        };
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
    fn new(mixture: &LobeMixture, points: &Points, values: &[f64]) -> Self {
        let all = points.pairs.iter().zip(&points.weights).zip(values);
        // The size of values does not matter, and squares of large ones are no numbers.
        let largest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        Self {
            densities: mixture
                .lobes
                .iter()
                .map(|(lobe, _)| points.densities(*lobe))
                .collect(),
            squares: all
                .map(|((pair, weight), value)| {
                    (value / largest * pair.incident[2]).powi(2) * weight
                })
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
                for lobe in mixture.lobes[index].0.variations(factor) {
                    let before = mixture.lobes[index].0;
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

    /// Steps that cannot make the sum larger: with r the share of a lobe in the density, s / p is at most
    /// the sum of r^2 s / (w p_lobe) for any other weights w, which is least for w as the root of its
    /// coefficient.
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
            mixture.normalize();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_lobe_among_those_tried_is_found_and_a_black_surface_gets_the_cosine() {
        let points = LobeMixture::pilot(true);
        let values: Vec<f64> = points
            .pairs
            .iter()
            .map(|p| {
                Lobe::Ggx {
                    alpha: [0.06; 2],
                    turn: 0.0,
                }
                .density(p.outgoing, p.incident)
                    / p.incident[2]
            })
            .collect();
        let found = LobeMixture::fit(&points, &values, true);
        let outgoing = cartesian(1.0, 0.0);
        let shares: Vec<(Lobe, f64)> = found.shares(outgoing).collect();
        let ggx = shares.iter().filter(
            |(lobe, _)| matches!(lobe, Lobe::Ggx { alpha: [alpha, _], .. } if (alpha / 0.06 - 1.0).abs() < 0.2),
        );
        let share: f64 = ggx.map(|(_, share)| share).sum();
        assert!(share > 0.85, "{shares:?}");

        let huge: Vec<f64> = values.iter().map(|value| 1e300 * value).collect();
        let same = LobeMixture::fit(&points, &huge, true);
        let incident = cartesian(0.9, 3.0);
        let ratio = same.density(outgoing, incident) / found.density(outgoing, incident);
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");

        let black = LobeMixture::fit(&points, &vec![0.0; points.pairs.len()], true);
        let incident = cartesian(0.5, 2.0);
        let density = black.density(outgoing, incident);
        let expected = 0.97 * 0.5_f64.cos() / PI + 0.03 / TAU;
        assert!((density - expected).abs() < 1e-12, "{black:?}");
    }
}

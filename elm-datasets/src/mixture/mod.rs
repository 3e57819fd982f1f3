//! Samples directions about in proportion to a model, by a mixture of a few [lobes](Lobe) in closed form.
//!
//! ```
//! use elm_datasets::{Brdf, geometry::{DirectionPair, cartesian}, lobes::Formula, mixture::LobeMixture};
//!
//! let plastic = Formula::lambert(0.5)?.with_ggx(0.04, 0.1)?;
//! let mixture = LobeMixture::of(&plastic)?;
//! let outgoing = cartesian(0.8, 0.3);
//! let (incident, density) = mixture.sample(outgoing, [0.3, 0.7]);
//! assert!((mixture.density(outgoing, incident) / density - 1.0).abs() < 1e-12);
//! // What a path tracer multiplies light by: about the albedo, wherever the direction falls.
//! let value = plastic.eval(&[DirectionPair { incident, outgoing }])?[[0, 0]];
//! assert!((0.1..1.5).contains(&(value * incident[2] / density)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod lobe;
mod search;

use std::f64::consts::{FRAC_PI_2, PI};

use crate::brdf::{Brdf, EvalError};
use crate::geometry::{DirectionPair, Vector, cartesian};
pub use lobe::Lobe;
use search::Problem;

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
/// Least shares of the cosine and of all directions alike, so that what was missed is found as well, next to
/// the horizon, too.
const LEAST: [f64; 2] = [0.07, 0.03];
/// Multiples of this angle fill the circle evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Coefficients of a weight as a polynomial in the viewer's cosine.
pub const TERMS: usize = 4;
/// Steps of the search for the weights, with all lobes or with the last, and after some are left out.
const STEPS: usize = 40;
const STEPS_AFTER: usize = 8;

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
#[derive(Debug, Clone, PartialEq)]
pub struct LobeMixture {
    /// Those of [`LEAST`] first.
    lobes: Vec<(Lobe, [f64; TERMS])>,
}

/// Directions at which a model is asked, each with the solid angle that it stands for.
#[derive(Debug, Clone)]
pub struct Points {
    pairs: Vec<DirectionPair>,
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
                // Each angle has a stretch of the sequence of its own.
                let numbers = low_discrepancy(view as u32 * count + index);
                let (incident, density) = mixture.sample(outgoing, numbers);
                pairs.push(DirectionPair { incident, outgoing });
                weights.push(1.0 / (density * f64::from(count)));
            }
        }
        Self { pairs, weights }
    }

    /// The pairs of directions.
    #[must_use]
    pub fn pairs(&self) -> &[DirectionPair] {
        &self.pairs
    }

    fn densities(&self, lobe: Lobe) -> Vec<f64> {
        let pairs = self.pairs.iter();
        pairs
            .map(|pair| lobe.density(pair.outgoing, pair.incident))
            .collect()
    }

    /// Directional albedo at each viewing angle (`theta_o` in radians, albedo) by the values at all pairs.
    #[must_use]
    pub fn albedo(&self, values: &[f64]) -> Vec<(f64, f64)> {
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

/// Two numbers in \[0, 1): M. Roberts's R2 sequence, multiples of the inverse of the root of
/// $x^3 = x + 1$ and of its square.
fn low_discrepancy(index: u32) -> [f64; 2] {
    const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    STEPS.map(|step| (0.5 + step * f64::from(index)).fract())
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

    /// The mixture of a model, by the mean of its channels. Asks it at 8,192 pairs.
    ///
    /// # Errors
    /// Those of the model's own evaluation.
    pub fn of(brdf: &dyn Brdf) -> Result<Self, EvalError> {
        let isotropic = brdf.is_isotropic();
        let points = Self::pilot(isotropic);
        let values = brdf.eval(&points.pairs)?;
        let safe = |value: f64| {
            if value.is_finite() {
                value.max(0.0)
            } else {
                0.0
            }
        };
        let rows = values.rows().into_iter();
        let values: Vec<f64> = rows
            .map(|row| row.iter().copied().map(safe).sum())
            .collect();
        Ok(Self::fit(&points, &values, isotropic))
    }

    /// Where a model is asked before anything is known of it.
    #[must_use]
    pub fn pilot(isotropic: bool) -> Points {
        Points::of(&Self::candidates(isotropic), PILOT)
    }

    /// Mirror and retro-reflection at each viewing angle, where models peak.
    #[must_use]
    pub fn peaks() -> Vec<DirectionPair> {
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
    #[must_use]
    pub fn points(&self) -> Points {
        Points::of(self, FINAL)
    }

    /// The mixture with the least variance of $f \cos\theta_i$ over its density, by the model's values,
    /// finite and not negative, at the pairs of [`pilot`](Self::pilot).
    #[must_use]
    pub fn fit(points: &Points, values: &[f64], isotropic: bool) -> Self {
        let mut mixture = Self::candidates(isotropic);
        let mut problem = Problem::new(&mixture, points, values);
        problem.improve(&mut mixture, STEPS);
        problem.eliminate(&mut mixture, LEAST.len() + KEPT);
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

    /// The lobes, each with the coefficients of its weight: of $(1-x)^3$, $3 (1-x)^2 x$, $3 (1-x) x^2$ and
    /// $x^3$ with $x$ the viewer's cosine.
    #[must_use]
    pub fn lobes(&self) -> &[(Lobe, [f64; TERMS])] {
        &self.lobes
    }

    /// The lobes with their shares at a viewer's [`terms`].
    fn shares(&self, terms: [f64; TERMS]) -> impl Iterator<Item = (Lobe, f64)> {
        let share =
            move |weights: &[f64; TERMS]| weights.iter().zip(terms).map(|(w, t)| w * t).sum();
        self.lobes
            .iter()
            .map(move |(lobe, weights)| (*lobe, share(weights)))
    }

    /// The lobe that a uniform number chooses, and where in that lobe's share the number lies, from 0 to 1.
    fn choose(&self, outgoing: Vector, u: f64) -> (Lobe, f64) {
        let (mut before, mut chosen) = (0.0, (Lobe::Cosine, u));
        for (lobe, share) in self.shares(terms(outgoing[2])) {
            if share > 0.0 && u >= before {
                chosen = (lobe, ((u - before) / share).min(1.0 - f64::EPSILON));
            }
            before += share;
        }
        chosen
    }

    /// An incident direction for a viewer at `outgoing`, from two numbers in \[0, 1), with its density in
    /// solid angle.
    #[must_use]
    pub fn sample(&self, outgoing: Vector, [a, b]: [f64; 2]) -> (Vector, f64) {
        let (lobe, a) = self.choose(outgoing, a);
        let incident = lobe.sample(outgoing, [a, b]);
        (incident, self.density(outgoing, incident))
    }

    /// The density in solid angle with which [`sample`](Self::sample) finds `incident`.
    #[must_use]
    pub fn density(&self, outgoing: Vector, incident: Vector) -> f64 {
        if incident[2].is_nan() || incident[2] <= 0.0 {
            return 0.0;
        }
        let parts = self
            .shares(terms(outgoing[2]))
            .map(|(lobe, share)| share * lobe.density(outgoing, incident));
        parts.sum()
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
        let shares: Vec<(Lobe, f64)> = found.shares(terms(outgoing[2])).collect();
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

//! The search for a mixture's weights, widths and tilts.

use std::ops::Range;

use ndarray::{Array1, ArrayView1};

use super::{LEAST, LobeMixture, Points, STEPS_AFTER, TERMS, VIEWS, terms, view_angle};

/// Rounds of the search for widths and tilts.
const ROUNDS: usize = 4;
/// Of the lobes that are too many, the part that is left out between searches for weights, as a divisor.
const QUARTER: usize = 4;

/// The search for weights: the least sum over viewing angles of the logarithm of the second moment of
/// $f \cos\theta_i$ over the density.
pub(super) struct Problem {
    /// Of each lobe at each point.
    densities: Vec<Vec<f64>>,
    /// The square of f cos theta_i at each point, times its solid angle.
    squares: Vec<f64>,
    terms: Vec<[f64; TERMS]>,
}

impl Problem {
    pub(super) fn new(mixture: &LobeMixture, points: &Points, values: &[f64]) -> Self {
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

    /// Those of a view.
    fn points(&self, view: usize) -> Range<usize> {
        let count = self.squares.len() / VIEWS;
        view * count..(view + 1) * count
    }

    /// The lobes' parts of the density at a view.
    fn shares(&self, mixture: &LobeMixture, view: usize) -> Vec<f64> {
        let shares: Vec<f64> = mixture
            .shares(self.terms[view])
            .map(|(_, share)| share)
            .collect();
        let total: f64 = shares.iter().sum();
        shares.iter().map(|share| share / total).collect()
    }

    /// Density of the mixture at each point of a view.
    fn mixed(&self, mixture: &LobeMixture, view: usize) -> Vec<f64> {
        let points = self.points(view);
        let mut mixed = vec![0.0; points.len()];
        let shares = self.shares(mixture, view);
        for (share, densities) in shares.iter().zip(&self.densities) {
            for (sum, density) in mixed.iter_mut().zip(&densities[points.clone()]) {
                *sum += share * density;
            }
        }
        for density in &mut mixed {
            *density = density.max(f64::MIN_POSITIVE);
        }
        mixed
    }

    fn objective(&self, mixture: &LobeMixture) -> f64 {
        let moment = |view: usize| -> f64 {
            let squares = &self.squares[self.points(view)];
            let ratios = squares.iter().zip(self.mixed(mixture, view));
            ratios.map(|(s, p)| s / p).sum()
        };
        let moments = (0..VIEWS).map(moment).filter(|&m| m > 0.0);
        moments.map(f64::ln).sum()
    }

    /// Of those that may be left out, the lobe without which the objective is least.
    fn least(&self, mixture: &LobeMixture) -> Option<usize> {
        let mut objectives = vec![0.0; mixture.lobes.len()];
        for view in 0..VIEWS {
            let points = self.points(view);
            let squares = &self.squares[points.clone()];
            let mixed = self.mixed(mixture, view);
            let shares = self.shares(mixture, view);
            for lobe in LEAST.len()..mixture.lobes.len() {
                let share = shares[lobe];
                // The least shares of the others keep the difference's digits.
                let ratio = |((s, p), density): ((&f64, &f64), &f64)| {
                    s / (p - share * density).max(f64::MIN_POSITIVE)
                };
                let all = squares
                    .iter()
                    .zip(&mixed)
                    .zip(&self.densities[lobe][points.clone()]);
                let moment = (1.0 - share) * all.map(ratio).sum::<f64>();
                if moment > 0.0 {
                    objectives[lobe] += moment.ln();
                }
            }
        }
        (LEAST.len()..mixture.lobes.len()).min_by(|&a, &b| objectives[a].total_cmp(&objectives[b]))
    }

    /// Leaves out lobes until `kept` are left, and searches for weights after each quarter.
    pub(super) fn eliminate(&mut self, mixture: &mut LobeMixture, kept: usize) {
        while mixture.lobes.len() > kept {
            for _ in 0..(mixture.lobes.len() - kept).div_ceil(QUARTER) {
                let Some(lobe) = self.least(mixture) else {
                    return;
                };
                mixture.lobes.remove(lobe);
                self.densities.remove(lobe);
                mixture.normalize();
            }
            self.improve(mixture, STEPS_AFTER);
        }
    }

    /// Takes widths and tilts between those tried.
    pub(super) fn refine(&mut self, points: &Points, mixture: &mut LobeMixture) {
        let mut factor = 1.25_f64;
        for _ in 0..ROUNDS {
            let mut best = self.objective(mixture);
            for index in LEAST.len()..mixture.lobes.len() {
                for lobe in mixture.lobes[index].0.variations(factor) {
                    let before = mixture.lobes[index].0;
                    mixture.lobes[index].0 = lobe;
                    let densities =
                        std::mem::replace(&mut self.densities[index], points.densities(lobe));
                    let found = self.objective(mixture);
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
    pub(super) fn improve(&mut self, mixture: &mut LobeMixture, steps: usize) {
        for _ in 0..steps {
            let mut gains = vec![[0.0; TERMS]; mixture.lobes.len()];
            for view in 0..VIEWS {
                let points = self.points(view);
                let squares = &self.squares[points.clone()];
                let mixed = self.mixed(mixture, view);
                let moment: f64 = squares.iter().zip(&mixed).map(|(s, p)| s / p).sum();
                if moment.is_nan() || moment <= 0.0 {
                    continue;
                }
                let ratios: Array1<f64> = squares
                    .iter()
                    .zip(&mixed)
                    .map(|(s, p)| s / (p * p))
                    .collect();
                for (gain, densities) in gains.iter_mut().zip(&self.densities) {
                    let sum = ratios.dot(&ArrayView1::from(&densities[points.clone()]));
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

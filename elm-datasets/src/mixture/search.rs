//! The search for a mixture's weights, widths and tilts.

use super::{LEAST, LobeMixture, Points, STEPS_AFTER, TERMS, VIEWS, terms, view_angle};

/// Rounds of the search for widths and tilts.
const ROUNDS: usize = 4;

/// The search for weights: the least sum over viewing angles of the logarithm of the second moment of
/// $f \cos\theta_i$ over the density.
pub(super) struct Problem {
    /// Of each lobe at each point.
    pub(super) densities: Vec<Vec<f64>>,
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

    pub(super) fn objective(&self, mixture: &LobeMixture, without: Option<usize>) -> f64 {
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
    pub(super) fn refine(&mut self, points: &Points, mixture: &mut LobeMixture) {
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
    pub(super) fn improve(&mut self, mixture: &mut LobeMixture, steps: usize) {
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
